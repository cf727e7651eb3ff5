"""Rules that see the verdict of the rules of the posterior, and may revise it."""

from __future__ import annotations

from dataclasses import replace

from bemt.judge.compare.recordings import NOTHING_SHARED, OTHER_STAND, REVERSED
from bemt.judge.diagnose import ratio_check, wrong_rotor_check
from bemt.judge.diagnose.explanation import NONE, Explanation
from bemt.judge.diagnose.rule import Rule, appended
from bemt.judge.diagnose.thresholds import LIKELY, MOST, RARE, SURE, UNCHANGED
from bemt.judge.diagnose.verdict import BESIDE_IT, CLAIMS, Decision, VerdictQuery

REVISIONS: list[Rule] = []
"""In the order in which they are asked."""
_rule = appended(REVISIONS, revises=True)


@_rule("another rotor than the case's", "FACTOR")
def _wrong_rotor_check(a: VerdictQuery) -> Decision | None:
    """Declared: loads off by a factor of three are those of another rotor, unit or speed before any physics."""
    said, problem = a.answer, a.found.problem
    if problem.by_laws:
        return None
    sure = said.effects[:1] if said.rule == BESIDE_IT else said.effects
    slip = (
        set(sure) & set(wrong_rotor_check.SLIPS)
        if said.verdict in ("named", "sensor") or said.rule == BESIDE_IT
        else ()
    )
    if not wrong_rotor_check.foreign(problem) or (slip and not wrong_rotor_check.odd_speed(problem, slip)):
        return None
    factor = wrong_rotor_check.FACTOR
    why = f"the loads are off by more than a factor of {factor:g}: first check that the case describes this rotor"
    return replace(said, verdict="insufficient", effects=(), classes=(), why=why)


@_rule("repeats differ as those of no stand", "UNREPEATABLE")
def _unrepeatable(a: VerdictQuery) -> Decision | None:
    """Declared: a tenth of the reading between repeats is something that changes and is not recorded."""
    if not wrong_rotor_check.unrepeatable(a.found.problem) or a.answer.verdict in ("none", "unknown"):
        return None
    why = "repeats at one condition differ by more than those of any stand: something that is not recorded changes"
    return replace(a.answer, verdict="insufficient", effects=(), classes=(), why=why)


@_rule("a recording contradicts itself")
def _contradicted(a: VerdictQuery) -> Decision | None:
    """By definition: what cannot be so is no unknown physics."""
    if a.answer.verdict != "unknown" or not wrong_rotor_check.impossible(a.found.problem):
        return None
    return replace(a.answer, verdict="insufficient", classes=(), why=wrong_rotor_check.CONTRADICTED)


@_rule("a wrong density that nobody recorded")
def _density_not_recorded(a: VerdictQuery) -> Decision | None:
    """By definition: a number that is not in the file has no unit; it only stands for loads off alike."""
    if a.answer.effects != ("unit_slip",) or any(
        p.record.air_recorded for p in a.found.problem.parts if not p.record.reference
    ):
        return None
    told = a.refined(a.answer.leading)[1]
    if told.get("unit_slip", {}).get("channel", {}).get("value") != "density_kg_m3":
        return None
    why = (
        "every load is off by the same share, as by a wrong density, which is not recorded: check units, speed and size"
    )
    return replace(a.answer, verdict="insufficient", effects=(), classes=(), why=why)


@_rule("the drive changed, the loads say nothing")
def _drive_alone(a: VerdictQuery) -> Decision | None:
    """Declared: loads that stay open do not veto the drive, unless what changes with time, or clearly changed from the
    reference, may have loaded the motor.
    """
    if a.drive is None or a.answer.effects or a.load_moves:
        return None
    if not a.alone and a.change is not None and ratio_check.clear_changes(a.change):
        return None
    changed = a.drive.verdict in ("named", "class") or (a.drive.verdict == "unknown" and a.answer.verdict == "none")
    return replace(a.drive, by="drive") if changed else None


@_rule("the drive changed as well")
def _drive_too(a: VerdictQuery) -> Decision | None:
    """Declared: both are measured apart, the loads at the measured speed and the speed at the pulse width."""
    said, drive = a.answer, a.drive
    if drive is None or said.by != "model" or said.verdict not in ("named", "sensor"):
        return None
    if drive.verdict != "named" or a.load_moves:
        return None
    chance = min(said.probability, drive.probability)
    return replace(said, verdict="named", effects=(*said.effects, *drive.effects), probability=chance, by="both")


@_rule("the ratios to the reference forbid a none", "UNCHANGED")
def _ratios_forbid_none(a: VerdictQuery) -> Decision | None:
    """Documented changes of real stands (cut tips, ducts, density) ended in "none": the case was too uncertain."""
    said = a.answer
    if said.by != "model" or said.verdict != "none" or a.alone or a.change is None:
        return None
    if a.change.loads.probability.get("none", 1.0) > UNCHANGED or not (moved := ratio_check.clear_changes(a.change)):
        return None
    why = f"{moved} from the reference, more than runs do, but no effect explains it better than the case's uncertainty"
    return replace(said, verdict="insufficient", why=why)


@_rule("the ratios to the reference show no change", "SURE")
def _ratios_show_none(a: VerdictQuery) -> Decision | None:
    """By definition: what differs from the model in the same way in both runs is no cause that came between them."""
    said = a.answer
    if said.by != "model" or said.verdict != "unknown" or a.alone or a.change is None:
        return None
    loads = a.change.loads
    if loads.verdict != "none" or loads.probability["none"] < SURE:
        return None
    why = f"{loads.why}; the model of the case differs from both in the same way"
    return replace(said, verdict="none", why=why, probability=loads.probability["none"])


@_rule("the ratios to the reference answer")
def _ratios_fill(a: VerdictQuery) -> Decision | None:
    """Declared: how loads changed between two runs is measured and needs no blade; only some causes scale like that."""
    said = a.answer
    if said.by != "model" or said.verdict != "insufficient" or a.alone or a.change is None:
        return None
    if a.change.loads.verdict not in CLAIMS:
        return None
    ratios = a.change.loads
    likely = {i: sum(p for k, p in a.P.items() if i in k.ids) for i in a.found.spans}
    # a single name is not for the ratios to give: they know no blade, and what the diagnosis holds likely may be it
    several = ratios.verdict == "class"
    weighed = set(ratios.probability) if several else set(ratios.effects)
    least = LIKELY if several else RARE
    lone = [i for i, p in sorted(likely.items(), key=lambda kv: -kv[1]) if p >= least and i not in weighed]
    chance = sum(ratios.probability.get(k, 0.0) for k in ratios.effects)
    return replace(
        said, verdict="class" if lone else ratios.verdict, effects=(*ratios.effects, *lone[:MOST]), probability=chance,
        classes=(), sets=(), why=ratios.why, by="ratios",
    )  # fmt: skip


@_rule("the loads agree, the drive does not")
def _drive_by_ratios(a: VerdictQuery) -> Decision | None:
    """By definition: speed or power at one command changed, where no pulse width lets the drive be modelled."""
    said, change = a.answer, a.change
    if said.by != "model" or said.verdict != "none" or a.drive is not None or a.alone or change is None:
        return None
    if change.leading is not change.drive or change.drive.verdict not in CLAIMS:
        return None
    drive = change.drive
    chance = sum(drive.probability.get(k, 0.0) for k in drive.effects)
    return replace(said, verdict=drive.verdict, effects=drive.effects, probability=chance, why=drive.why, by="ratios")


@_rule("two recordings without a case: the densities that both tell")
def _density_told(a: VerdictQuery) -> Decision | None:
    """By definition: where the coefficients agree and the recorded densities do not, the density is what changed."""
    if a.pair is None or a.answer.verdict != "none" or not (why := a.pair.by_density):
        return None
    what = Explanation.of("air_density")
    return replace(
        a.answer, verdict="named", effects=("air_density",), leading=what, probability=a.P[NONE], why=why, by="ratios"
    )


@_rule("two recordings without a case: thrust of the other sign")
def _thrust_turned(a: VerdictQuery) -> Decision | None:
    """By definition: nothing but the cell or the sense of rotation turns thrust round."""
    if a.pair is None or not a.pair.turned or a.answer.effects != ("unit_slip",):
        return None
    return replace(a.answer, why=REVERSED)


@_rule("two recordings without a case: electrical power for torque")
def _by_proxy(a: VerdictQuery) -> Decision | None:
    """Declared: nothing unlisted, and no single name, where the losses of a motor are in the readings."""
    if a.pair is None or not a.pair.by_proxy:
        return None
    if a.answer.verdict not in ("unknown", "named", "sensor") and a.answer.rule != BESIDE_IT:
        return None
    why = "electrical power replaces torque and includes the losses of the motor"
    return replace(a.answer, verdict="insufficient", effects=(), classes=(), sets=(), why=why)


@_rule("two recordings without a case: nothing shared, or no one stand")
def _not_comparable(a: VerdictQuery) -> Decision | None:
    """Declared: two extrapolations, an unstated wind or loads of two stands are no change of one rotor.

    A ratio of pole pairs moves the speeds apart itself, a unit the loads.
    """
    if a.pair is None:
        return None
    said, why = a.answer, ""
    slips = set(said.effects) <= {"rpm_scale", "unit_slip"} and bool(said.effects)
    if a.pair.apart and not slips:
        why = NOTHING_SHARED
    elif a.pair.far_off and not set(said.effects) & {"rpm_scale", "unit_slip"}:
        why = OTHER_STAND
    if said.verdict != "none" and a.pair.wind:
        why = a.pair.wind
    return replace(said, verdict="insufficient", effects=(), classes=(), sets=(), why=why) if why else None
