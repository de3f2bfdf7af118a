// The kinematics plugin of MoveIt: `Arm` behind the interface kinematics::KinematicsBase.

#pragma once

#if __has_include(<moveit/kinematics_base/kinematics_base.hpp>)
#include <moveit/kinematics_base/kinematics_base.hpp>
#else  // Humble and Iron
#include <moveit/kinematics_base/kinematics_base.h>
#endif

#include <chrono>
#include <memory>
#include <string>
#include <vector>

#include "jacokin_moveit/arm.hpp"

namespace jacokin_moveit {

class KinematicsPlugin : public kinematics::KinematicsBase {
 public:
  using Message = geometry_msgs::msg::Pose;
  using ErrorCode = moveit_msgs::msg::MoveItErrorCodes;
  using Options = kinematics::KinematicsQueryOptions;

  // Loads the file that the parameter robot_description_kinematics.<group>.jacokin_solver_file names, and refuses it
  // where its joints have other names than the group's, or its tool is not where the robot model has the tip.
  bool initialize(const rclcpp::Node::SharedPtr& node, const moveit::core::RobotModel& robot_model,
                  const std::string& group_name, const std::string& base_frame,
                  const std::vector<std::string>& tip_frames, double search_discretization) override;

  // The configuration nearest to the seed.
  bool getPositionIK(const Message& ik_pose, const std::vector<double>& ik_seed_state, std::vector<double>& solution,
                     ErrorCode& error_code, const Options& options = Options()) const override;

  // Every configuration, nearest to the seed first; of seven joints those with the redundant one at the seed's value
  // (NO_DISCRETIZATION), or samples of all of them (ALL_DISCRETIZED).
  bool getPositionIK(const std::vector<Message>& ik_poses, const std::vector<double>& ik_seed_state,
                     std::vector<std::vector<double>>& solutions, kinematics::KinematicsResult& result,
                     const Options& options) const override;

  // The configuration nearest to the seed, within the consistency limits, that the callback accepts, before the
  // timeout [s]. Others than these four forms are those of the base class.
  bool searchPositionIK(const Message& ik_pose, const std::vector<double>& ik_seed_state, double timeout,
                        std::vector<double>& solution, ErrorCode& error_code,
                        const Options& options = Options()) const override;
  bool searchPositionIK(const Message& ik_pose, const std::vector<double>& ik_seed_state, double timeout,
                        const std::vector<double>& consistency_limits, std::vector<double>& solution,
                        ErrorCode& error_code, const Options& options = Options()) const override;
  bool searchPositionIK(const Message& ik_pose, const std::vector<double>& ik_seed_state, double timeout,
                        std::vector<double>& solution, const IKCallbackFn& solution_callback, ErrorCode& error_code,
                        const Options& options = Options()) const override;
  bool searchPositionIK(const Message& ik_pose, const std::vector<double>& ik_seed_state, double timeout,
                        const std::vector<double>& consistency_limits, std::vector<double>& solution,
                        const IKCallbackFn& solution_callback, ErrorCode& error_code,
                        const Options& options = Options()) const override;
  using kinematics::KinematicsBase::searchPositionIK;

  // Of the tip only.
  bool getPositionFK(const std::vector<std::string>& link_names, const std::vector<double>& joint_angles,
                     std::vector<Message>& poses) const override;

  // Joint 3 of seven joints, or none.
  bool setRedundantJoints(const std::vector<unsigned int>& redundant_joint_indices) override;
  using kinematics::KinematicsBase::setRedundantJoints;

  const std::vector<std::string>& getJointNames() const override { return joint_names_; }
  const std::vector<std::string>& getLinkNames() const override { return link_names_; }

 private:
  // The pose as the C library takes it; nothing where the question cannot be asked.
  std::optional<Pose> target_of(const Message& pose, const std::vector<double>& seed) const;
  // The configuration nearest to the seed; nothing where there is none that is within the bounds of the robot model as
  // it is: then another candidate may be nearest.
  std::optional<Configuration> find_nearest(const Pose& target, const std::vector<double>& seed) const;
  // Candidates that are within the bounds of the robot model, too; nothing where the library refuses the pose.
  std::optional<Candidates> find(const Pose& target, const std::vector<double>& seed, bool hold_redundant) const;
  // Moves joints by whole turns into the bounds of the robot model where they are outside; false where none fits.
  bool bring_within_bounds(Configuration& q) const;
  // An empty string, or how the exported arm differs from the robot model.
  std::string difference_from(const moveit::core::RobotModel& robot_model) const;

  struct Bounds {
    double lower, upper;  // [rad], infinite without bounds
  };

  std::unique_ptr<Arm> arm_;  // null until it is initialized
  std::vector<std::string> joint_names_, link_names_;
  std::vector<Bounds> bounds_;  // those of the robot model and the exported limits, whichever is narrower
};

}  // namespace jacokin_moveit
