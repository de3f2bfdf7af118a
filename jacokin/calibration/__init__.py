"""Which arm it really is: from measured poses to the joints of one arm. Read `estimation` first.

Everything public is imported from here.

estimation        `calibrate`: the most probable arm, gross errors left out and named
measurements      what an instrument, or none, says: positions, poses, distances, contact
arm_model         the numbers that may be off, and what they make of a measurement
alignment         where base, tool and touched places are, to start from
findings          what a fit says, what is sure about it and what is not; what measurements can tell apart
calibration       the arm that was found, to load, to write and to report; whether two found the same arm
design            which configurations to measure, and how good the result will be
"""

from jacokin import lazy

__all__, __getattr__, __dir__ = lazy.door(__name__)
