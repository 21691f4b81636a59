"""Property tests: the same examples everywhere, and no limit on time on shared machines."""

from hypothesis import settings

settings.register_profile("lockedjoint", deadline=None, derandomize=True, max_examples=30)
settings.load_profile("lockedjoint")
