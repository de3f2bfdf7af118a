// Stub: where the links are; a transform has what the plugin uses of Eigen::Isometry3d.
#pragma once

#include <moveit/robot_model/robot_model.hpp>

namespace moveit::core {

class Isometry {
 public:
  explicit Isometry(const std::array<double, 16>& values) : values_(values) {}
  double operator()(int row, int column) const { return values_[static_cast<std::size_t>(4 * row + column)]; }

  Isometry inverse() const {
    std::array<double, 16> made{};
    for (int i = 0; i < 3; ++i)
      for (int j = 0; j < 3; ++j) {
        made[static_cast<std::size_t>(4 * i + j)] = (*this)(j, i);
        made[static_cast<std::size_t>(4 * i + 3)] -= (*this)(j, i) * (*this)(j, 3);
      }
    made[15] = 1.0;
    return Isometry(made);
  }

  Isometry operator*(const Isometry& other) const {
    std::array<double, 16> made{};
    for (int i = 0; i < 4; ++i)
      for (int j = 0; j < 4; ++j)
        for (int k = 0; k < 4; ++k) made[static_cast<std::size_t>(4 * i + j)] += (*this)(i, k) * other(k, j);
    return Isometry(made);
  }

 private:
  std::array<double, 16> values_;
};

class RobotState {
 public:
  explicit RobotState(const RobotModelConstPtr& model) : model_(model) {}
  void setToDefaultValues() { q_.assign(model_->group.names.size(), 0.0); }
  void setJointGroupPositions(const JointModelGroup*, const std::vector<double>& q) { q_ = q; }
  void updateLinkTransforms() {}

  // The base is not where the world is.
  Isometry getGlobalLinkTransform(const std::string& link) const {
    const Isometry base({0, -1, 0, 1, 1, 0, 0, 2, 0, 0, 1, 3, 0, 0, 0, 1});
    return link == "base" ? base : base * Isometry(model_->forward(q_));
  }

 private:
  RobotModelConstPtr model_;
  std::vector<double> q_;
};

}  // namespace moveit::core
