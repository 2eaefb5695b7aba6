"""Recovery laws by name."""

from collections.abc import Callable, Container

from companion.recovery.adaptive import AdaptiveLaw
from companion.recovery.interface import RecoveryConfig, RecoveryLaw
from companion.recovery.normal import NormalLaw
from companion.recovery.paper import PaperLaw

RECOVERY_LAWS: dict[str, Callable[[RecoveryConfig], RecoveryLaw]] = {
    PaperLaw.name: PaperLaw,
    NormalLaw.name: NormalLaw,
    AdaptiveLaw.name: AdaptiveLaw,
}


def check_known_law(name: str, known: Container[str]) -> None:
    """Raise ValueError, naming the choices, for a law that does not exist."""
    if name not in known:
        raise ValueError(f"there is no recovery law '{name}'; the laws are: {', '.join(sorted(RECOVERY_LAWS))}")
