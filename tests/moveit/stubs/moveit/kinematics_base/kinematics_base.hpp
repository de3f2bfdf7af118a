// Stub: what the plugin uses and overrides of kinematics::KinematicsBase in MoveIt 2, with its signatures.
#pragma once

#include <functional>
#include <geometry_msgs/msg/pose.hpp>
#include <map>
#include <moveit/robot_state/robot_state.hpp>
#include <moveit_msgs/msg/move_it_error_codes.hpp>
#include <rclcpp/rclcpp.hpp>
#include <string>
#include <vector>

namespace kinematics {

namespace DiscretizationMethods {
enum DiscretizationMethod {
  NO_DISCRETIZATION = 1,
  ALL_DISCRETIZED,
  SOME_DISCRETIZED,
  ALL_RANDOM_SAMPLED,
  SOME_RANDOM_SAMPLED
};
}
using DiscretizationMethod = DiscretizationMethods::DiscretizationMethod;

namespace KinematicErrors {
enum KinematicError {
  OK = 1,
  UNSUPORTED_DISCRETIZATION_REQUESTED,
  DISCRETIZATION_NOT_INITIALIZED,
  MULTIPLE_TIPS_NOT_SUPPORTED,
  EMPTY_TIP_POSES,
  IK_SEED_OUTSIDE_LIMITS,
  SOLVER_NOT_ACTIVE,
  NO_SOLUTION
};
}
using KinematicError = KinematicErrors::KinematicError;

struct KinematicsQueryOptions {
  bool lock_redundant_joints = false;
  bool return_approximate_solution = false;
  DiscretizationMethod discretization_method = DiscretizationMethods::NO_DISCRETIZATION;
};

struct KinematicsResult {
  KinematicError kinematic_error;
  double solution_percentage;
};

using PoseMessage = geometry_msgs::msg::Pose;
using CodeMessage = moveit_msgs::msg::MoveItErrorCodes;

class KinematicsBase {
 public:
  using IKCallbackFn = std::function<void(const PoseMessage&, const std::vector<double>&, CodeMessage&)>;

  virtual ~KinematicsBase() = default;

  virtual bool getPositionIK(const PoseMessage& ik_pose, const std::vector<double>& ik_seed_state,
                             std::vector<double>& solution, CodeMessage& error_code,
                             const KinematicsQueryOptions& options = KinematicsQueryOptions()) const = 0;
  virtual bool getPositionIK(const std::vector<PoseMessage>& ik_poses, const std::vector<double>& ik_seed_state,
                             std::vector<std::vector<double>>& solutions, KinematicsResult& result,
                             const KinematicsQueryOptions& options) const = 0;
  virtual bool searchPositionIK(const PoseMessage& ik_pose, const std::vector<double>& ik_seed_state, double timeout,
                                std::vector<double>& solution, CodeMessage& error_code,
                                const KinematicsQueryOptions& options = KinematicsQueryOptions()) const = 0;
  virtual bool searchPositionIK(const PoseMessage& ik_pose, const std::vector<double>& ik_seed_state, double timeout,
                                const std::vector<double>& consistency_limits, std::vector<double>& solution,
                                CodeMessage& error_code,
                                const KinematicsQueryOptions& options = KinematicsQueryOptions()) const = 0;
  virtual bool searchPositionIK(const PoseMessage& ik_pose, const std::vector<double>& ik_seed_state, double timeout,
                                std::vector<double>& solution, const IKCallbackFn& solution_callback,
                                CodeMessage& error_code,
                                const KinematicsQueryOptions& options = KinematicsQueryOptions()) const = 0;
  virtual bool searchPositionIK(const PoseMessage& ik_pose, const std::vector<double>& ik_seed_state, double timeout,
                                const std::vector<double>& consistency_limits, std::vector<double>& solution,
                                const IKCallbackFn& solution_callback, CodeMessage& error_code,
                                const KinematicsQueryOptions& options = KinematicsQueryOptions()) const = 0;
  virtual bool getPositionFK(const std::vector<std::string>& link_names, const std::vector<double>& joint_angles,
                             std::vector<PoseMessage>& poses) const = 0;
  virtual bool initialize(const rclcpp::Node::SharedPtr& node, const moveit::core::RobotModel& robot_model,
                          const std::string& group_name, const std::string& base_frame,
                          const std::vector<std::string>& tip_frames, double search_discretization) = 0;
  virtual const std::vector<std::string>& getJointNames() const = 0;
  virtual const std::vector<std::string>& getLinkNames() const = 0;

  virtual bool setRedundantJoints(const std::vector<unsigned int>& indices) {
    redundant_joint_indices_ = indices;
    setSearchDiscretization(0.1);
    return true;
  }
  bool setRedundantJoints(const std::vector<std::string>& names) {
    std::vector<unsigned int> indices;
    for (unsigned int j = 0; j < getJointNames().size(); ++j)
      for (const std::string& name : names)
        if (getJointNames()[j] == name) indices.push_back(j);
    return indices.size() == names.size() && setRedundantJoints(indices);
  }
  void setSearchDiscretization(double step) {
    redundant_joint_discretization_.clear();
    for (unsigned int index : redundant_joint_indices_) redundant_joint_discretization_[static_cast<int>(index)] = step;
  }
  double getSearchDiscretization(int joint_index = 0) const {
    const auto found = redundant_joint_discretization_.find(joint_index);
    return found == redundant_joint_discretization_.end() ? 0.0 : found->second;
  }

 protected:
  void storeValues(const moveit::core::RobotModel& robot_model, const std::string& group_name,
                   const std::string& base_frame, const std::vector<std::string>& tip_frames,
                   double search_discretization) {
    robot_model_ = robot_model.shared_from_this();
    group_name_ = group_name;
    base_frame_ = base_frame;
    tip_frames_ = tip_frames;
    setSearchDiscretization(search_discretization);
  }

  rclcpp::Node::SharedPtr node_;
  moveit::core::RobotModelConstPtr robot_model_;
  std::string group_name_, base_frame_;
  std::vector<std::string> tip_frames_;
  double default_timeout_ = 1.0;
  std::vector<unsigned int> redundant_joint_indices_;
  std::map<int, double> redundant_joint_discretization_;
  std::vector<DiscretizationMethod> supported_methods_;
};

}  // namespace kinematics
