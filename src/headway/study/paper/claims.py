"""All claims of the text, in order, and by the model that they speak of."""

from __future__ import annotations

from headway.study.paper import across, cooperative, general_motors, intelligent_driver, optimal_velocity
from headway.study.paper.verdicts import Claim

__all__ = ["CLAIMS", "GROUPS"]

#: model → its claims; `all` compare the models
GROUPS: dict[str, tuple[Claim, ...]] = {
    "cacc": cooperative.CLAIMS,
    "idm": intelligent_driver.CLAIMS,
    "ovm": optimal_velocity.CLAIMS,
    "gmm": general_motors.CLAIMS,
    "all": across.CLAIMS,
}

CLAIMS: dict[str, Claim] = {
    claim.id: claim
    for claim in sorted((claim for group in GROUPS.values() for claim in group), key=lambda claim: claim.id)
}
