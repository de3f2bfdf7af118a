from jacokin.viewer.inspector import Inspector as Inspector
from jacokin.viewer.serving import ViewerOptions as ViewerOptions
from jacokin.viewer.serving import serve as serve
from jacokin.viewer.serving import show as show
from jacokin.viewer.view import View as View
from jacokin.viewer.viewer import Viewer as Viewer

__all__: list[str]
