from jacokin.model.comparison import CrossCheckReport as CrossCheckReport
from jacokin.model.comparison import Deviation as Deviation
from jacokin.model.comparison import crosscheck as crosscheck
from jacokin.model.contact import SelfContact as SelfContact
from jacokin.model.contact_observer import ContactObserver as ContactObserver
from jacokin.model.contact_observer import ContactStep as ContactStep
from jacokin.model.descriptions.bundled import DEFAULT_ROBOT as DEFAULT_ROBOT
from jacokin.model.descriptions.bundled import NAMES as NAMES
from jacokin.model.descriptions.bundled import urdf_folder as urdf_folder
from jacokin.model.dynamics import ExternalWrench as ExternalWrench
from jacokin.model.loading import load_robot as load_robot
from jacokin.model.mujoco_twin import to_mujoco as to_mujoco
from jacokin.model.obstacles import Attached as Attached
from jacokin.model.obstacles import Box as Box
from jacokin.model.obstacles import Capsule as Capsule
from jacokin.model.obstacles import Cylinder as Cylinder
from jacokin.model.obstacles import Floor as Floor
from jacokin.model.obstacles import Obstacle as Obstacle
from jacokin.model.obstacles import Sphere as Sphere
from jacokin.model.poses import pose as pose
from jacokin.model.poses import pose_from_kinova as pose_from_kinova
from jacokin.model.poses import pose_to_kinova as pose_to_kinova
from jacokin.model.poses import quat_wxyz as quat_wxyz
from jacokin.model.robot import Robot as Robot
from jacokin.model.robot import Source as Source
from jacokin.model.scene import Scene as Scene

__all__: list[str]
