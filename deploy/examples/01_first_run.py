"""Lose a leader: run a shipped scenario in virtual time, kill the leader, see who leads on and how fast."""

from lfa.deploy.simulate import run

done = run("straight", seed=7, set=["mission.leading.route_m=[[6.0, 0.0]]"], faults=["kill leader at 5 s"])

summary = done.summary
print(f"{summary.scenario}: {summary.outcome} after {summary.sim_duration_s:.1f} s")
for leader in summary.leaders:
    print(f"robot {leader.robot_id} leads from {leader.from_s:.2f} s on ({leader.cause})")
for failover in summary.failovers:
    print(f"robot {failover.leader} holds the lease {failover.lease_ms:.0f} ms after robot {failover.victim} died")
for robot in summary.robots:
    if robot.distance_error_rms_m is not None:
        print(f"robot {robot.id} keeps its distance within {1000.0 * robot.distance_error_rms_m:.1f} mm (rms)")
print(f"everything about this run is in {done.folder}; a page about it: lfa report {done.folder}")
