"""The judge: which answers are admissible for a ray, and whether given hits are. Shares no code with the engine."""

from refsim.oracle.admissible import Admissible, admissible, bodies_of
from refsim.oracle.judge import Reason, Verdicts, judge

__all__ = ["Admissible", "Reason", "Verdicts", "admissible", "bodies_of", "judge"]
