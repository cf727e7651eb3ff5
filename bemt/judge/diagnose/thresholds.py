"""Numbers that the rules of the verdict ask with: how much is enough for which answer."""

__all__ = [
    "ANOTHER", "BESIDE", "BOTH", "EARNED", "END", "ENOUGH", "EXACT", "EXPECTED", "GATE", "IN_SET", "LARGEST",
    "LEAST", "LEFT_OVER", "LIKE", "LIKELY", "MOST", "NAMED", "NEAR", "NEARLY", "PARTNER", "PREDICTS", "PROVEN",
    "RARE", "ROUGH", "SETTLED", "SMALL", "SURE", "UNCHANGED", "VAGUE",
]  # fmt: skip

GATE, NEARLY = 0.01, 5.0
"""Largest p-value at which a mismatch counts as one; factor on it within which it nearly does [1]."""
SURE = 0.85
"""Probability from which a class of effects is an answer [1]."""
NAMED = 0.95
"""The same of a single name: between the two, of the claims of one proof, four in ten were wrong [1]."""
BOTH = 0.92
"""The same of each of two, about its root, so that both together are as sure [1]."""
LEFT_OVER = 4.0
"""Log odds of a smooth rest beside the best listed effect over no rest, from which the cause is unknown [1]."""
SMALL = 0.1
"""A rest this small beside what the effect explains (both as log odds) is a detail of it, not another cause [1]."""
EARNED = 8.0
"""Log odds that each effect of a pair must add to the other alone: small model errors are not a second cause [1]."""
ENOUGH, LEAST, EXPECTED = 8.0, 5.0, 2.5
"""Log odds over none (about 4 sigma) from which a name is given at all; of what no error of the solver can look like,
since there is a reference or it follows a recorded variable of its own, other than a drift; of physics known to be
left out [1]."""
PROVEN, PREDICTS = 20.0, 0.9
"""Below the first (log odds) an explanation must lower the error on left-out blocks to the second, a ratio; physics
that is on already needs the first in any case, to be on differently [1]."""
PARTNER, LIKE, MOST = 0.05, 0.1, 3
"""Probability beside a sure effect from which a second one is mentioned (three single names of one set of concealed
causes had such a second one, and all were of two causes); the same beside look-alikes, and the share of the likeliest
second one that others mentioned with it have at least; most members of an open answer [1]."""
RARE = 0.02
"""Members of a class are at least this share as likely as the likeliest [1]."""
NEAR = 5.0
"""Effects of a class may be this far (natural logarithm of the evidence) behind the best one [1]."""

ANOTHER = 0.25
"""All loads off the case by more than this, at usual: pitch, section, density, speed or diameter may each be it [1]."""
VAGUE = 2.5
"""Log odds of something unknown over nothing from which an explanation must predict, too [1]."""
BESIDE = 0.1
"""Share of an effect's probability that "unknown" may keep beside it and the effect still be named [1]."""
ROUGH = 3.0
"""Noise over what the recording states from which on something else is at work than any effect explains [1]."""
IN_SET, LARGEST = 0.95, 6
"""Share of the probability of two causes that their sets hold; most effects of both together [1]."""
SETTLED = 0.67
"""Probability of one ratio of units from which a slip of the airspeed is named: between two of them is no slip [1]."""
END = 0.01
"""As near to an end of its range, a share of it, a parameter of a pair is at the end [1]."""
UNCHANGED, LIKELY = 0.15, 0.1
"""Probability of no change in the ratios to the reference below which "none" is no answer; probability in the diagnosis
from which an effect that no scaling law describes joins the class of the ratios [1]."""
EXACT = 1e4
"""Odds that a relation of one file which must hold, and holds after one listed repair to 0.1 %, was broken by that: as
many ratios fit in between [1]."""
