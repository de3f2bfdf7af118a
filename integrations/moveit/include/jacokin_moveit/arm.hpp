// Candidates for MoveIt from the C library: configurations that reach a pose, nearest to a seed first. No ROS in here.

#pragma once

#include <memory>
#include <mutex>
#include <optional>
#include <string>
#include <vector>

#include "jacokin_ik.hpp"

namespace jacokin_moveit {

using jacokin::Configuration;
using jacokin::Pose;

// What one pose has given.
struct Candidates {
  std::vector<Configuration> within_limits;  // nearest to the seed first
  std::size_t explored = 0;                  // how many there are with those outside the limits
};

// How the redundant joint of seven is chosen.
struct Redundancy {
  bool held = false;  // at the seed's value
  double step = 0.1;  // else in steps of so much, with the ends of what is within the limits [rad]
};

// One exported arm; any number of threads may use it at a time.
class Arm {
 public:
  // Throws jacokin::Error where the file cannot be used.
  explicit Arm(const std::string& solver_file);

  const jacokin::Solver& solver() const { return solver_; }

  // Index of the joint that is free to choose on an arm of seven joints; 0 on one of six.
  unsigned int redundant_joint() const { return solver_.dof() == 7 ? static_cast<unsigned int>(solver_.parameter()) : 0; }

  // The configuration within the limits that is nearest to the seed; nothing where there is none.
  // Throws as `find`.
  std::optional<Configuration> nearest(const Pose& target, const Configuration& seed) const;

  // Every configuration within the limits of six joints; of seven, the nearest one and samples of all others, which
  // takes much longer than the nearest one alone.
  // Throws jacokin::Error for numbers that are not finite and a pose that is not rigid.
  Candidates find(const Pose& target, const Configuration& seed, const Redundancy& redundancy) const;

 private:
  // Work memory lent to one call, and kept for the next: seven joints need 5 MB.
  class Lease {
   public:
    explicit Lease(const Arm& arm);
    ~Lease();
    Lease(const Lease&) = delete;
    Lease& operator=(const Lease&) = delete;
    jacokin::Work& work() { return *work_; }

   private:
    const Arm& arm_;
    std::unique_ptr<jacokin::Work> work_;
  };

  Candidates branches(const Pose& target, const Configuration& seed, jacokin::Work& work) const;
  Candidates solutions(const Pose& target, const Configuration& seed, const Redundancy& redundancy,
                       jacokin::Work& work) const;

  jacokin::Solver solver_;
  mutable std::mutex mutex_;
  mutable std::vector<std::unique_ptr<jacokin::Work>> idle_;
};

// Put the rows nearest to the seed first.
void sort_by_distance(std::vector<Configuration>& rows, const Configuration& seed);

// The 4x4 matrix of a position [m] and a quaternion; nothing where its norm is not within 1 % of 1.
std::optional<Pose> pose_from_quaternion(double x, double y, double z, double qx, double qy, double qz, double qw);

// The quaternion x, y, z, w of a pose.
std::array<double, 4> quaternion_of(const Pose& pose);

}  // namespace jacokin_moveit
