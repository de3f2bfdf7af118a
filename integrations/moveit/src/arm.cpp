#include "jacokin_moveit/arm.hpp"

#include <algorithm>
#include <cmath>

namespace jacokin_moveit {

namespace {

double distance(const Configuration& a, const Configuration& b) {
  double square = 0.0;
  for (std::size_t j = 0; j < a.size(); ++j) square += (a[j] - b[j]) * (a[j] - b[j]);
  return std::sqrt(square);
}

}  // namespace

void sort_by_distance(std::vector<Configuration>& rows, const Configuration& seed) {
  std::stable_sort(rows.begin(), rows.end(), [&seed](const Configuration& a, const Configuration& b) {
    return distance(a, seed) < distance(b, seed);
  });
}

Arm::Arm(const std::string& solver_file) : solver_(solver_file) {}

Arm::Lease::Lease(const Arm& arm) : arm_(arm) {
  const std::lock_guard<std::mutex> lock(arm.mutex_);
  if (!arm.idle_.empty()) {
    work_ = std::move(arm.idle_.back());
    arm.idle_.pop_back();
  } else {
    work_ = std::make_unique<jacokin::Work>(arm.solver_, JACOKIN_IK_POSES);
  }
}

Arm::Lease::~Lease() {
  const std::lock_guard<std::mutex> lock(arm_.mutex_);
  arm_.idle_.push_back(std::move(work_));
}

std::optional<Configuration> Arm::nearest(const Pose& target, const Configuration& seed) const {
  Lease lease(*this);
  return solver_.nearest(target, seed, lease.work());
}

Candidates Arm::find(const Pose& target, const Configuration& seed, const Redundancy& redundancy) const {
  Lease lease(*this);
  return solver_.dof() == 6 ? branches(target, seed, lease.work()) : solutions(target, seed, redundancy, lease.work());
}

Candidates Arm::branches(const Pose& target, const Configuration& seed, jacokin::Work& work) const {
  Candidates found;
  for (const jacokin::Branch& branch : solver_.all(target, seed, work).branches) {
    ++found.explored;
    if (branch.success != 0) found.within_limits.emplace_back(branch.q, branch.q + solver_.dof());
  }
  return found;
}

Candidates Arm::solutions(const Pose& target, const Configuration& seed, const Redundancy& redundancy,
                          jacokin::Work& work) const {
  Candidates found;
  if (!redundancy.held) {
    if (const auto nearest = solver_.nearest(target, seed, work)) found.within_limits.push_back(*nearest);
  }
  const double step = redundancy.step > 0.0 ? redundancy.step : 0.1;
  for (const jacokin::Interval& interval : solver_.intervals(target, work).intervals) {
    std::vector<double> parameters;
    if (redundancy.held) {
      const double turn = 2.0 * 3.141592653589793;
      const double middle = 0.5 * (interval.start + interval.stop);
      const double wanted = seed[redundant_joint()];
      const double at = wanted + turn * std::round((middle - wanted) / turn);
      if (interval.start <= at && at <= interval.stop) parameters.push_back(at);
    } else {
      const int steps = std::max(1, static_cast<int>(std::ceil((interval.stop - interval.start) / step)));
      for (int i = 0; i <= steps; ++i)
        parameters.push_back(interval.start + (interval.stop - interval.start) * i / steps);
    }
    for (double parameter : parameters) {
      if (auto q = solver_.at(interval, parameter, seed, work)) found.within_limits.push_back(std::move(*q));
    }
  }
  sort_by_distance(found.within_limits, seed);
  found.explored = found.within_limits.size();
  return found;
}

std::optional<Pose> pose_from_quaternion(double x, double y, double z, double qx, double qy, double qz, double qw) {
  const double norm = std::sqrt(qx * qx + qy * qy + qz * qz + qw * qw);
  if (!(std::abs(norm - 1.0) <= 0.01) || !std::isfinite(x + y + z)) return std::nullopt;
  qx /= norm, qy /= norm, qz /= norm, qw /= norm;
  return Pose{1.0 - 2.0 * (qy * qy + qz * qz), 2.0 * (qx * qy - qz * qw),       2.0 * (qx * qz + qy * qw),       x,
              2.0 * (qx * qy + qz * qw),       1.0 - 2.0 * (qx * qx + qz * qz), 2.0 * (qy * qz - qx * qw),       y,
              2.0 * (qx * qz - qy * qw),       2.0 * (qy * qz + qx * qw),       1.0 - 2.0 * (qx * qx + qy * qy), z,
              0.0,                             0.0,                             0.0,                             1.0};
}

std::array<double, 4> quaternion_of(const Pose& T) {
  // The largest of the four is never small, and the others follow from it.
  const std::array<double, 4> squares = {1.0 + T[0] - T[5] - T[10], 1.0 - T[0] + T[5] - T[10],
                                         1.0 - T[0] - T[5] + T[10], 1.0 + T[0] + T[5] + T[10]};
  const auto largest = std::max_element(squares.begin(), squares.end()) - squares.begin();
  const double scale = 0.5 / std::sqrt(squares[static_cast<std::size_t>(largest)]);
  const double xy = scale * (T[1] + T[4]), xz = scale * (T[2] + T[8]), yz = scale * (T[6] + T[9]);
  const double xw = scale * (T[9] - T[6]), yw = scale * (T[2] - T[8]), zw = scale * (T[4] - T[1]);
  const double root = 0.5 * std::sqrt(squares[static_cast<std::size_t>(largest)]);
  if (largest == 0) return {root, xy, xz, xw};
  if (largest == 1) return {xy, root, yz, yw};
  if (largest == 2) return {xz, yz, root, zw};
  return {xw, yw, zw, root};
}

}  // namespace jacokin_moveit
