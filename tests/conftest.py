"""For all tests: an example of a property may take as long as the machine takes, since speed belongs to `lfa bench`;
and Ctrl-C means what it says, also to a run that a shell has started in the background, where it is ignored.
"""

import signal

from hypothesis import settings

settings.register_profile("unhurried", deadline=None)
settings.load_profile("unhurried")

signal.signal(signal.SIGINT, signal.default_int_handler)
