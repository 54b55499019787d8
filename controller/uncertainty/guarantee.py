"""What is guaranteed of an answer for an uncertain world, and how exactly."""

from typing import NamedTuple


class Guarantee(NamedTuple):
    """What is guaranteed of the contacts, if the world is in the set.

    Attributes:
        stability: "strong" for one contact, whose force is unique: it is admissible in every world. "weak" for several,
            whose squeeze nothing determines: in every world there is an admissible force (Pang and Trinkle 2000).
        excess: by how much [N] the cones may be higher than the set asks for, before pushes are added; 0: by nothing.
        proved: whether all worlds are covered by a proof from the start, as for one contact in the plane. Else what is
            added where forces bend out of the cones between the vertices of the set is an estimate, also where it is
            nothing; for one contact `slack_bounds` then proves it of the answer at hand, or finds a world that is lost.
    """

    stability: str
    excess: float
    proved: bool
