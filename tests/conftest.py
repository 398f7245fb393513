"""How all tests draw: Hypothesis from a seed fixed by the test itself, the same in every run, and without a clock.

To look for new counterexamples: `pytest --hypothesis-profile=explore`; a failure prints how to have it again.
"""

from hypothesis import settings

settings.register_profile("fixed", deadline=None, derandomize=True, print_blob=True)
settings.register_profile("explore", deadline=None, print_blob=True)
settings.load_profile("fixed")
