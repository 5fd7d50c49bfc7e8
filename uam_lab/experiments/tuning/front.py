"""Two objectives: the cost of the flights, as small as possible, and the delay margin, as large.

The front contains the candidates that no other one surpasses in both. Its hypervolume is the area
that it dominates, from REFERENCE on. A search has converged when its last evaluations improved the
result, the least cost or this area, by less than a share.
"""

import math
from collections.abc import Sequence

from optuna.trial import FrozenTrial

from uam_control.profiles.profile import Profile
from uam_sim_bridge.plant import Vehicle

PAYLOADS = (0.0, 0.2)  # [kg] on the magnet, of which the smaller margin counts
# corner of the area: the logarithm of the cost 10, and no margin [s]
WORST_COST, NO_MARGIN = 10.0, 0.0
SMALL = 0.01  # share of the result
LEAST = 20  # evaluations without improvement from which on a search may be called converged


def delay_margin(profile: Profile) -> float:
    """Return the delay margin [s] of the setpoint path; 0 if a loop is unstable (`uam margins`)."""
    # the import takes a fifth of a second; `uam --help` skips it
    from uam_lab.experiments.margins.cases import cases_of, smallest_delay

    cases = cases_of(profile, Vehicle.of(profile.vehicle), PAYLOADS)
    return smallest_delay(cases)[0] if all(case.analysis.stable for case in cases) else 0.0


def front(trials: Sequence[FrozenTrial]) -> list[FrozenTrial]:
    """Return the trials that no other one surpasses, by increasing cost."""
    found: list[FrozenTrial] = []
    for trial in sorted(trials, key=lambda one: (one.values[0], -one.values[1])):
        if not found or trial.values[1] > found[-1].values[1]:
            found.append(trial)
    return found


def area(trials: Sequence[FrozenTrial]) -> float:
    """Return the hypervolume of the front of `trials` [ms]: margin times ln(WORST_COST / cost)."""
    total, corner = 0.0, NO_MARGIN
    for trial in front(trials):
        cost, margin = trial.values
        if cost < WORST_COST and margin > corner:
            total += 1e3 * (margin - corner) * math.log(WORST_COST / cost)
            corner = margin
    return total


def hypervolumes(trials: Sequence[FrozenTrial]) -> list[float]:
    """Return the hypervolume after each of `trials`, in their order."""
    known: list[FrozenTrial] = []
    found = []
    for trial in trials:
        known = front([*known, trial])
        found.append(area(known))
    return found


def chosen(trials: Sequence[FrozenTrial], at_least: float) -> FrozenTrial:
    """Return the trial of least cost with a margin of `at_least` [s], else that of most margin."""
    enough = [trial for trial in trials if trial.values[1] >= at_least]
    if enough:
        return min(enough, key=lambda one: one.values[0])
    return max(trials, key=lambda one: one.values[1])


def improvement(curve: Sequence[float], patience: int) -> float:
    """Return by which share the last `patience` evaluations improved the result.

    curve: best cost, or area under the front, after each evaluation. infinity while there are not
    more evaluations than that, for a patience below 1, or if the result before was zero.
    """
    if patience < 1 or len(curve) <= patience or curve[-1 - patience] == 0.0:
        return math.inf
    before = curve[-1 - patience]
    return abs(curve[-1] - before) / abs(before)


def convergence(curve: Sequence[float], patience: int) -> str:
    """Return one line: whether the search has converged, and why."""
    share = improvement(curve, patience)
    if math.isinf(share):
        return f"not converged: {len(curve)} evaluations, of which the last {patience} would count"
    state = "converged" if share < SMALL else "not converged"
    return f"{state}: the last {patience} of {len(curve)} evaluations improved it by {share:.2%}"
