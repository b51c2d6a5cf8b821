"""For all tests: an example of a property may take as long as the machine takes, since speed belongs to `lfa bench`."""

from hypothesis import settings

settings.register_profile("unhurried", deadline=None)
settings.load_profile("unhurried")
