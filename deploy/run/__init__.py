"""Running a scenario: in virtual time, or as processes on this machine; its faults; its recording."""
