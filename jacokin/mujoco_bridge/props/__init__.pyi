from jacokin.mujoco_bridge.props.brick import Brick as Brick
from jacokin.mujoco_bridge.props.from_files import Mesh as Mesh
from jacokin.mujoco_bridge.props.from_files import ModelFile as ModelFile
from jacokin.mujoco_bridge.props.pedestal import Cradle as Cradle
from jacokin.mujoco_bridge.props.pedestal import Pedestal as Pedestal
from jacokin.mujoco_bridge.props.primitive import BoxProp as BoxProp
from jacokin.mujoco_bridge.props.primitive import FreeProp as FreeProp
from jacokin.mujoco_bridge.props.primitive import FreePropObservables as FreePropObservables
from jacokin.mujoco_bridge.props.primitive import Primitive as Primitive
from jacokin.mujoco_bridge.props.primitive import large_box as large_box

__all__: list[str]
