"""All claims of the text, in order, and by the model that they speak of."""

from __future__ import annotations

from headway.literature.barhoumi2025 import across, claims_cacc, claims_gmm, claims_idm, claims_ovm
from headway.literature.barhoumi2025.verdicts import Claim

__all__ = ["CLAIMS", "GROUPS"]

#: model → its claims; `all` compare the models
GROUPS: dict[str, tuple[Claim, ...]] = {
    "cacc": claims_cacc.CLAIMS,
    "idm": claims_idm.CLAIMS,
    "ovm": claims_ovm.CLAIMS,
    "gmm": claims_gmm.CLAIMS,
    "all": across.CLAIMS,
}

CLAIMS: dict[str, Claim] = {
    claim.id: claim
    for claim in sorted((claim for group in GROUPS.values() for claim in group), key=lambda claim: claim.id)
}
