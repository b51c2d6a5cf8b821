"""Inject faults drawn in Python, and check the invariants of the lease on what the run has recorded."""

from random import Random

from lfa.deploy.analysis.verification.journals import verify
from lfa.deploy.simulate import run

TEAM = (1, 2, 3)


def drawn(chance: Random) -> list[str]:
    """Return faults as sentences, in the grammar that `lfa run --fault` has too."""
    victim, other = chance.sample(TEAM, 2)
    return [
        f"stop {victim} at {chance.uniform(2.0, 3.0):.2f} s for 1 s",
        f"cut {other} at {chance.uniform(3.0, 4.0):.2f} s for 2 s",
        f"loss 0.2 at {chance.uniform(6.0, 7.0):.2f} s for 1 s",
    ]


faults = drawn(Random(2))
done = run("straight", seed=2, robots=len(TEAM), set=["mission.leading.route_m=[[3.0, 0.0]]"], faults=faults)
verdict = verify(done.folder)

print(f"injected: {', '.join(faults)}")
print(f"led by robots {', '.join(str(leader.robot_id) for leader in done.summary.leaders)}; {done.summary.outcome}")
print(f"{verdict.happenings} facts from {verdict.journals} journals checked, {len(verdict.broken)} violations")
for violation in verdict.broken:
    print(f"{violation.name} at {violation.at:.3f} s: {violation.text}")
