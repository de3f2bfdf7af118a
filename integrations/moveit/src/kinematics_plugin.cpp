#include "jacokin_moveit/kinematics_plugin.hpp"

#if __has_include(<moveit/robot_state/robot_state.hpp>)
#include <moveit/robot_model/robot_model.hpp>
#include <moveit/robot_state/robot_state.hpp>
#else  // Humble and Iron
#include <moveit/robot_model/robot_model.h>
#include <moveit/robot_state/robot_state.h>
#endif

#include <algorithm>
#include <cmath>
#include <limits>
#include <pluginlib/class_list_macros.hpp>
#include <rclcpp/rclcpp.hpp>

namespace jacokin_moveit {

namespace {

using kinematics::DiscretizationMethods::ALL_DISCRETIZED;
using kinematics::DiscretizationMethods::NO_DISCRETIZATION;

// [m] and [-] The exported arm and the robot model may place the tip this far apart: descriptions of the same arm
// differ by rounding to six digits, another arm or tool by millimetres.
constexpr double kSameTip = 1e-5;
constexpr double kTurn = 2.0 * 3.141592653589793;  // [rad]

rclcpp::Logger logger() { return rclcpp::get_logger("jacokin_kinematics_plugin"); }

// Whether a joint of MoveIt is that of the file, which has no prefix such as "j2n6s300_".
bool is_same_joint(const std::string& in_model, const std::string& in_file) {
  if (in_model == in_file) return true;
  const std::string ending = "_" + in_file;
  return in_model.size() > ending.size() && in_model.compare(in_model.size() - ending.size(), ending.size(), ending) == 0;
}

}  // namespace

bool KinematicsPlugin::initialize(const rclcpp::Node::SharedPtr& node, const moveit::core::RobotModel& robot_model,
                                  const std::string& group_name, const std::string& base_frame,
                                  const std::vector<std::string>& tip_frames, double search_discretization) {
  arm_.reset();
  node_ = node;
  storeValues(robot_model, group_name, base_frame, tip_frames, search_discretization);
  const moveit::core::JointModelGroup* group = robot_model.getJointModelGroup(group_name);
  if (group == nullptr || tip_frames.size() != 1) {
    RCLCPP_ERROR(logger(), "group '%s' must exist and have one tip", group_name.c_str());
    return false;
  }
  const std::string parameter = "robot_description_kinematics." + group_name + ".jacokin_solver_file";
  if (!node->has_parameter(parameter)) node->declare_parameter<std::string>(parameter, "");
  const std::string file = node->get_parameter(parameter).as_string();
  try {
    arm_ = std::make_unique<Arm>(file);
  } catch (const jacokin::Error& error) {
    RCLCPP_ERROR(logger(), "%s = '%s': %s", parameter.c_str(), file.c_str(), error.what());
    return false;
  }
  joint_names_ = group->getActiveJointModelNames();
  link_names_ = {tip_frames.front()};
  bounds_.clear();
  const std::string difference = difference_from(robot_model);
  if (!difference.empty()) {
    RCLCPP_ERROR(logger(), "%s is not the arm of group '%s': %s", file.c_str(), group_name.c_str(), difference.c_str());
    arm_.reset();
    return false;
  }
  const Configuration lower = arm_->solver().lower(), upper = arm_->solver().upper();
  for (std::size_t j = 0; j < lower.size(); ++j) {
    const moveit::core::VariableBounds& bounds = group->getActiveJointModels()[j]->getVariableBounds().front();
    const double infinity = std::numeric_limits<double>::infinity();
    bounds_.push_back({std::max(lower[j], bounds.position_bounded_ ? bounds.min_position_ : -infinity),
                       std::min(upper[j], bounds.position_bounded_ ? bounds.max_position_ : infinity)});
  }
  supported_methods_ = {NO_DISCRETIZATION, ALL_DISCRETIZED};
  if (arm_->solver().dof() == 7 && setRedundantJoints(std::vector<unsigned int>{arm_->redundant_joint()}))
    setSearchDiscretization(search_discretization);
  return true;
}

std::string KinematicsPlugin::difference_from(const moveit::core::RobotModel& robot_model) const {
  const std::vector<std::string> names = arm_->solver().joint_names();
  if (names.size() != joint_names_.size()) {
    return "it has " + std::to_string(names.size()) + " joints, the group " + std::to_string(joint_names_.size());
  }
  for (std::size_t j = 0; j < names.size(); ++j) {
    if (!is_same_joint(joint_names_[j], names[j])) return "its joint " + names[j] + " is " + joint_names_[j] + " there";
  }
  // Base, tool and every length agree where the tip does, at two configurations without symmetry.
  moveit::core::RobotState state(robot_model_);
  for (const double offset : {0.0, 0.37}) {
    Configuration q = arm_->solver().home();
    for (std::size_t j = 0; j < q.size(); ++j) q[j] += offset * (static_cast<double>(j) + 1.0);
    state.setToDefaultValues();
    state.setJointGroupPositions(robot_model.getJointModelGroup(group_name_), q);
    state.updateLinkTransforms();
    const auto tip = state.getGlobalLinkTransform(base_frame_).inverse() * state.getGlobalLinkTransform(tip_frames_[0]);
    const Pose expected = arm_->solver().forward(q);
    double worst = 0.0;
    for (int row = 0; row < 3; ++row)
      for (int column = 0; column < 4; ++column)
        worst = std::max(worst, std::abs(tip(row, column) - expected[static_cast<std::size_t>(4 * row + column)]));
    if (!(worst <= kSameTip)) {
      return "its " + arm_->solver().frame() + " is not where the tip " + tip_frames_[0] + " is, by " +
             std::to_string(worst) + "; export it with --base, --frame and --tool for these";
    }
  }
  return "";
}

bool KinematicsPlugin::setRedundantJoints(const std::vector<unsigned int>& indices) {
  const bool is_redundant = arm_ != nullptr && arm_->solver().dof() == 7;
  for (const unsigned int index : indices) {
    if (!is_redundant || index != arm_->redundant_joint()) return false;
  }
  return KinematicsBase::setRedundantJoints(indices);
}

bool KinematicsPlugin::bring_within_bounds(Configuration& q) const {
  // Candidates are copies near to the seed, which another copy within narrower bounds need not be.
  for (std::size_t j = 0; j < q.size(); ++j) {
    const double lower = bounds_[j].lower, upper = bounds_[j].upper;
    if (q[j] < lower) q[j] += kTurn * std::ceil((lower - q[j]) / kTurn);
    if (q[j] > upper) q[j] -= kTurn * std::ceil((q[j] - upper) / kTurn);
    if (!(lower <= q[j] && q[j] <= upper)) return false;
  }
  return true;
}

std::optional<Pose> KinematicsPlugin::target_of(const Message& message, const std::vector<double>& seed) const {
  if (arm_ == nullptr) {
    RCLCPP_ERROR(logger(), "the solver is not initialized");
    return std::nullopt;
  }
  const auto& p = message.position;
  const auto& o = message.orientation;
  const std::optional<Pose> target = pose_from_quaternion(p.x, p.y, p.z, o.x, o.y, o.z, o.w);
  if (!target || seed.size() != joint_names_.size()) {
    RCLCPP_ERROR(logger(), "the pose must have a unit quaternion and the seed %zu joints", joint_names_.size());
    return std::nullopt;
  }
  return target;
}

std::optional<Configuration> KinematicsPlugin::find_nearest(const Pose& target,
                                                            const std::vector<double>& seed) const {
  try {
    const std::optional<Configuration> nearest = arm_->nearest(target, seed);
    if (!nearest) return std::nullopt;
    Configuration within = *nearest;
    return bring_within_bounds(within) && within == *nearest ? nearest : std::nullopt;
  } catch (const jacokin::Error& error) {
    RCLCPP_ERROR(logger(), "%s", error.what());
    return std::nullopt;
  }
}

std::optional<Candidates> KinematicsPlugin::find(const Pose& target, const std::vector<double>& seed,
                                                 bool hold_redundant) const {
  try {
    const Redundancy redundancy{hold_redundant, getSearchDiscretization(arm_->redundant_joint())};
    Candidates found = arm_->find(target, seed, redundancy);
    std::vector<Configuration> kept;
    for (Configuration& q : found.within_limits) {
      if (bring_within_bounds(q)) kept.push_back(std::move(q));
    }
    found.within_limits = std::move(kept);
    sort_by_distance(found.within_limits, seed);
    return found;
  } catch (const jacokin::Error& error) {
    RCLCPP_ERROR(logger(), "%s", error.what());
    return std::nullopt;
  }
}

bool KinematicsPlugin::getPositionIK(const Message& pose, const std::vector<double>& seed,
                                     std::vector<double>& solution, ErrorCode& error_code,
                                     const Options& options) const {
  return searchPositionIK(pose, seed, default_timeout_, {}, solution, IKCallbackFn(), error_code, options);
}

bool KinematicsPlugin::getPositionIK(const std::vector<Message>& poses, const std::vector<double>& seed,
                                     std::vector<std::vector<double>>& solutions, kinematics::KinematicsResult& result,
                                     const Options& options) const {
  using namespace kinematics::KinematicErrors;
  solutions.clear();
  result.solution_percentage = 0.0;
  const auto refuse = [&result](kinematics::KinematicError error) {
    result.kinematic_error = error;
    return false;
  };
  if (arm_ == nullptr) return refuse(SOLVER_NOT_ACTIVE);
  if (poses.empty()) return refuse(EMPTY_TIP_POSES);
  if (poses.size() > 1) return refuse(MULTIPLE_TIPS_NOT_SUPPORTED);
  if (options.discretization_method != NO_DISCRETIZATION && options.discretization_method != ALL_DISCRETIZED)
    return refuse(UNSUPORTED_DISCRETIZATION_REQUESTED);
  const bool hold = options.lock_redundant_joints || options.discretization_method == NO_DISCRETIZATION;
  const std::optional<Pose> target = target_of(poses.front(), seed);
  if (!target) return refuse(NO_SOLUTION);
  const std::optional<Candidates> found = find(*target, seed, hold);
  if (!found || found->within_limits.empty()) return refuse(NO_SOLUTION);
  solutions = found->within_limits;
  result.kinematic_error = OK;
  result.solution_percentage = static_cast<double>(solutions.size()) / static_cast<double>(found->explored);
  return true;
}

bool KinematicsPlugin::searchPositionIK(const Message& pose, const std::vector<double>& seed, double timeout,
                                        std::vector<double>& solution, ErrorCode& error_code,
                                        const Options& options) const {
  return searchPositionIK(pose, seed, timeout, {}, solution, IKCallbackFn(), error_code, options);
}

bool KinematicsPlugin::searchPositionIK(const Message& pose, const std::vector<double>& seed, double timeout,
                                        const std::vector<double>& consistency_limits, std::vector<double>& solution,
                                        ErrorCode& error_code, const Options& options) const {
  return searchPositionIK(pose, seed, timeout, consistency_limits, solution, IKCallbackFn(), error_code, options);
}

bool KinematicsPlugin::searchPositionIK(const Message& pose, const std::vector<double>& seed, double timeout,
                                        std::vector<double>& solution, const IKCallbackFn& solution_callback,
                                        ErrorCode& error_code, const Options& options) const {
  return searchPositionIK(pose, seed, timeout, {}, solution, solution_callback, error_code, options);
}

bool KinematicsPlugin::searchPositionIK(const Message& pose, const std::vector<double>& seed, double timeout,
                                        const std::vector<double>& consistency_limits, std::vector<double>& solution,
                                        const IKCallbackFn& solution_callback, ErrorCode& error_code,
                                        const Options& options) const {
  const auto start = std::chrono::steady_clock::now();
  const std::chrono::duration<double> allowed(timeout > 0.0 ? timeout : default_timeout_);
  error_code.val = ErrorCode::NO_IK_SOLUTION;
  solution.clear();
  if (!consistency_limits.empty() && consistency_limits.size() != joint_names_.size()) {
    RCLCPP_ERROR(logger(), "consistency limits must be %zu numbers", joint_names_.size());
    return false;
  }
  const std::optional<Pose> target = target_of(pose, seed);
  if (!target) return false;
  const auto is_consistent = [&](const Configuration& q) {
    for (std::size_t j = 0; j < consistency_limits.size(); ++j)
      if (!(std::abs(q[j] - seed[j]) <= consistency_limits[j])) return false;
    return true;
  };
  // Whether the question is answered: by this configuration, or because the time is over.
  const auto is_answered_by = [&](const Configuration& q) {
    if (!is_consistent(q)) return false;
    error_code.val = ErrorCode::SUCCESS;
    if (solution_callback) {
      if (std::chrono::steady_clock::now() - start > allowed) {
        error_code.val = ErrorCode::TIMED_OUT;
        return true;
      }
      solution_callback(pose, q, error_code);
    }
    if (error_code.val == ErrorCode::SUCCESS) {
      solution = q;
      return true;
    }
    error_code.val = ErrorCode::NO_IK_SOLUTION;
    return false;
  };
  // Of seven joints, the nearest is found without the samples of all others, which take much longer.
  std::optional<Configuration> nearest;
  if (arm_->solver().dof() == 7 && !options.lock_redundant_joints) {
    nearest = find_nearest(*target, seed);
    if (nearest && is_answered_by(*nearest)) return error_code.val == ErrorCode::SUCCESS;
  }
  const std::optional<Candidates> found = find(*target, seed, options.lock_redundant_joints);
  if (!found) return false;
  for (const Configuration& q : found->within_limits) {
    if (nearest && q == *nearest) continue;
    if (is_answered_by(q)) return error_code.val == ErrorCode::SUCCESS;
  }
  return false;
}

bool KinematicsPlugin::getPositionFK(const std::vector<std::string>& links, const std::vector<double>& q,
                                     std::vector<Message>& poses) const {
  poses.clear();
  if (arm_ == nullptr || q.size() != joint_names_.size()) return false;
  for (const std::string& link : links) {
    if (link != link_names_.front()) {
      RCLCPP_ERROR(logger(), "forward kinematics is for %s only, not for %s", link_names_.front().c_str(), link.c_str());
      poses.clear();
      return false;
    }
    try {
      const Pose pose = arm_->solver().forward(q);
      const std::array<double, 4> quaternion = quaternion_of(pose);
      Message message;
      message.position.x = pose[3];
      message.position.y = pose[7];
      message.position.z = pose[11];
      message.orientation.x = quaternion[0];
      message.orientation.y = quaternion[1];
      message.orientation.z = quaternion[2];
      message.orientation.w = quaternion[3];
      poses.push_back(message);
    } catch (const jacokin::Error& error) {
      RCLCPP_ERROR(logger(), "%s", error.what());
      poses.clear();
      return false;
    }
  }
  return true;
}

}  // namespace jacokin_moveit

PLUGINLIB_EXPORT_CLASS(jacokin_moveit::KinematicsPlugin, kinematics::KinematicsBase)
