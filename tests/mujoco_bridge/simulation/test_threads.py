"""One physics in several threads: calls wait for one another. Unguarded, MuJoCo crashes the interpreter."""

from __future__ import annotations

from tests.programs import python

THREADS = """
import threading

import numpy as np

from jacokin.mujoco_bridge import JacoArm, JacoHand, Physics

arm, hand = JacoArm(), JacoHand()
arm.attach(hand)
physics = Physics.from_entity(arm)
arm.set_home(physics)
before = physics.time
failures = []

def work(number):
    try:
        rng = np.random.default_rng(number)
        joints, site = physics.bind(arm.joints), physics.bind(hand.pinch_site)
        for i in range(150):
            physics.step(2)
            assert np.isfinite(site.xpos).all()
            if i % 10 == 0:
                physics.forward()
                state = physics.get_state()
                with physics.lock:
                    joints.qpos[0] += 0.001 * rng.uniform()
                    assert physics.bind(arm.wrist_site).xpos.shape == (3,)
            if i % 50 == 0:
                with physics.disable("gravity"):
                    physics.step()
                hand.set_grasp(physics, rng.uniform())
    except BaseException as error:
        failures.append(repr(error))

threads = [threading.Thread(target=work, args=(number,)) for number in range(8)]
for thread in threads:
    thread.start()
for thread in threads:
    thread.join()
assert not failures, failures
steps = round((physics.time - before) / physics.timestep)
assert steps == 8 * (150 * 2 + 3), steps
print("done")
"""


def test_eight_threads_take_turns() -> None:
    done = python("-c", THREADS, timeout=120.0)
    assert (done.stdout, done.stderr) == ("done\n", "")
