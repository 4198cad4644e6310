"""What `llrp check` finds in a recording or a running robot: what is wrong, the likely cause, and the mend.

One pass, in the time it takes to decode the pictures, and in constant memory: each part keeps counts and extremes.
"""

from agents.checks.checker import Checker, check
from agents.checks.finding import Finding, Severity
from agents.checks.proposal import Proposal, propose
from agents.checks.survey import Survey

__all__ = ["Checker", "Finding", "Proposal", "Severity", "Survey", "check", "propose"]
