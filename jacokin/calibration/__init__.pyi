from jacokin.calibration.arm_model import Prior as Prior
from jacokin.calibration.calibration import Calibration as Calibration
from jacokin.calibration.calibration import Comparison as Comparison
from jacokin.calibration.calibration import compare as compare
from jacokin.calibration.design import Accuracy as Accuracy
from jacokin.calibration.design import plan_measurements as plan_measurements
from jacokin.calibration.design import predict_accuracy as predict_accuracy
from jacokin.calibration.estimation import calibrate as calibrate
from jacokin.calibration.findings import Estimate as Estimate
from jacokin.calibration.measurements import Measurements as Measurements

__all__: list[str]
