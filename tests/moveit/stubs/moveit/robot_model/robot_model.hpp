// Stub: a robot model with one group of joints, whose kinematics are a function of the test.
#pragma once

#include <array>
#include <functional>
#include <memory>
#include <string>
#include <vector>

namespace moveit::core {

struct VariableBounds {
  double min_position_ = 0.0, max_position_ = 0.0;
  bool position_bounded_ = false;
};

class JointModel {
 public:
  using Bounds = std::vector<VariableBounds>;
  const Bounds& getVariableBounds() const { return bounds; }

  Bounds bounds;
};

class JointModelGroup {
 public:
  const std::vector<std::string>& getActiveJointModelNames() const { return names; }
  const std::vector<const JointModel*>& getActiveJointModels() const { return joints; }

  std::vector<std::string> names;
  std::vector<const JointModel*> joints;
};

class RobotModel : public std::enable_shared_from_this<RobotModel> {
 public:
  const JointModelGroup* getJointModelGroup(const std::string& name) const { return name == "arm" ? &group : nullptr; }

  JointModelGroup group;
  std::function<std::array<double, 16>(const std::vector<double>&)> forward;  // pose of the tip in the base
};

using RobotModelConstPtr = std::shared_ptr<const RobotModel>;

}  // namespace moveit::core
