"""How late a robot's machine keeps it, and what it does less often then."""
