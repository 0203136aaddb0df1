"""Errors of contacts without a state."""

from __future__ import annotations

from mlsanm_cli.errors import NumericalError


class UnbalancedError(NumericalError):
    """No contact pressure balances the loads."""


class NoStateError(UnbalancedError):
    """No contact status satisfies all conditions."""

    def __init__(self) -> None:
        super().__init__(
            "no contact state balances the loads",
            "bodies may slide or roll apart: raise friction, or fix them; a force-controlled platen may push "
            "its body away from the contact, or nothing resists its direction: prescribe that direction's "
            "displacement instead",
        )


class EndlessError(NumericalError):
    """The search ended without a state although pressures balance the loads, as may happen where the
    compliance is not positive definite."""

    def __init__(self) -> None:
        super().__init__(
            "no contact state has been found although pressures can balance the loads",
            "the clouds along the contact may be too coarse or too different; at high friction there may "
            "also be no continuous path",
        )


class SlidingError(NumericalError):
    """The contact slides as a whole and nothing else carries the load: the path ends here."""

    def __init__(self, fraction: float, where: str = "") -> None:
        super().__init__(
            f"the contact slides as a whole{where}",
            "prescribe the displacement instead of the force to continue",
        )
        self.fraction = fraction
