// jacokin_ik.hpp: jacokin_ik.h for C++17, header only.
//
//     jacokin::Solver arm("j2n6s300.jacokin");
//     jacokin::Work work;                             // one for each thread, for any solver and call
//     jacokin::Pose target = arm.forward(q);          // std::array<double, 16>, row by row [m]
//     if (auto answer = arm.nearest(target, seed, work)) move_to(*answer);
//     for (const auto& branch : arm.all(target, seed, work).branches) ...
//     jacokin::Batch many = arm.batch(targets, {}, work);
//     if (many.success(3)) move_to(many.configuration(3));
//
// Not reaching a pose is an empty answer; a wrong argument or file is a jacokin::Error with the library's sentence.
// What everything means is said in jacokin_ik.h.

#pragma once

#include <array>
#include <cstddef>
#include <memory>
#include <optional>
#include <stdexcept>
#include <string>
#include <vector>

#include "jacokin_ik.h"

namespace jacokin {

using Pose = std::array<double, 16>;         // 4x4, row by row
using Configuration = std::vector<double>;   // one angle for each joint [rad]
using Branch = jacokin_ik_branch;
using Interval = jacokin_ik_interval;
using Axis = jacokin_ik_axis;

// A call that could not be done.
class Error : public std::runtime_error {
 public:
  explicit Error(int code) : std::runtime_error(jacokin_ik_status_text(code)), status(code) {}
  const int status;  // enum jacokin_ik_status, below 0
};

class Solver;

// Memory that calls work in: one for each thread. It grows to what a call needs, and is then kept; no call allocates
// with one that was made for the solver and its task.
class Work {
 public:
  Work() = default;
  explicit Work(const Solver& solver, jacokin_ik_task task = JACOKIN_IK_POSES);

  // For the functions of jacokin_ik.h: address and bytes.
  void* data() { return memory_.data(); }
  std::size_t size() const { return memory_.size() * sizeof(double); }

  // Hold at least what a solver's task needs.
  void fit(const Solver& solver, jacokin_ik_task task);

 private:
  std::vector<double> memory_;
};

// All branches of a pose, nearest to the seed first.
struct Branches {
  std::vector<Branch> branches;
  int status;     // JACOKIN_IK_OK where one is a success, else why none is
  bool complete;  // whether none is missing
};

// The nearest configurations of many poses.
struct Batch {
  std::vector<double> q;    // a row of dof angles for each target [rad]; NaN where it has no answer
  std::vector<int> status;  // of each target: what nearest() says

  std::size_t size() const { return status.size(); }
  bool success(std::size_t i) const { return status.at(i) == JACOKIN_IK_OK; }
  Configuration configuration(std::size_t i) const {
    const std::size_t dof = status.empty() ? 0 : q.size() / status.size();
    (void)status.at(i);
    return Configuration(q.data() + dof * i, q.data() + dof * (i + 1));
  }
};

// A configuration of a target with one free parameter.
struct Solution {
  Configuration q;   // [rad]
  double parameter;  // [rad] the angle about a free axis, in its range; or that of the joint that is the parameter
};

// All configurations with one free parameter, as intervals of it.
struct SolutionSet {
  std::vector<Interval> intervals;
  int status;     // JACOKIN_IK_OK where there is an interval, else why there is none
  bool complete;  // whether nothing is missing
};

// One arm with its frame, tool and limits; any number of threads may use it at a time.
class Solver {
 public:
  // From a file that `jacokin export-c` wrote.
  explicit Solver(const std::string& path) {
    jacokin_ik_solver* made = nullptr;
    check(jacokin_ik_load(path.c_str(), &made));
    solver_.reset(made);
  }

  // From the contents of such a file, which are copied.
  Solver(const void* contents, std::size_t size) {
    jacokin_ik_solver* made = nullptr;
    check(jacokin_ik_read(contents, size, &made));
    solver_.reset(made);
  }

  std::size_t dof() const { return static_cast<std::size_t>(jacokin_ik_dof(get())); }
  // Index of the joint that is the parameter of a seven-joint arm; -1 for six joints.
  int parameter() const { return jacokin_ik_parameter(get()); }
  std::string robot() const { return jacokin_ik_robot(get()); }
  std::string base() const { return jacokin_ik_base(get()); }
  std::string frame() const { return jacokin_ik_frame(get()); }

  std::vector<std::string> joint_names() const {
    std::vector<std::string> names;
    for (int j = 0; j < jacokin_ik_dof(get()); ++j) names.emplace_back(jacokin_ik_joint_name(get(), j));
    return names;
  }

  Configuration lower() const { return limits(0); }
  Configuration upper() const { return limits(1); }
  Configuration home() const { return limits(2); }

  // The pose of the tool in the base.
  Pose forward(const Configuration& q) const {
    Pose pose{};
    check(jacokin_fk(get(), checked(q), pose.data()));
    return pose;
  }

  // Every branch of a pose of a six-joint arm, within the limits or not.
  Branches all(const Pose& target, const Configuration& seed, Work& work) const {
    Branches found{std::vector<Branch>(JACOKIN_IK_MAX_BRANCHES), 0, false};
    int count = 0, complete = 0;
    work.fit(*this, JACOKIN_IK_POSES);
    found.status = check(jacokin_ik_all(get(), target.data(), checked(seed), work.data(), work.size(),
                                        found.branches.data(), JACOKIN_IK_MAX_BRANCHES, &count, &complete));
    found.branches.resize(static_cast<std::size_t>(count));
    found.complete = complete != 0;
    return found;
  }

  // The configuration within the limits nearest to the seed; nothing where none reaches the pose. `status` says why.
  std::optional<Configuration> nearest(const Pose& target, const Configuration& seed, Work& work,
                                       int* status = nullptr) const {
    Configuration q(dof());
    work.fit(*this, JACOKIN_IK_POSES);
    const int found = check(jacokin_ik_nearest(get(), target.data(), checked(seed), work.data(), work.size(), q.data()));
    if (status != nullptr) *status = found;
    return found == JACOKIN_IK_OK ? std::optional<Configuration>(q) : std::nullopt;
  }

  // The configurations nearest to their seeds, one for each target; without seeds, nearest to home.
  Batch batch(const std::vector<Pose>& targets, const std::vector<Configuration>& seeds, Work& work) const {
    Batch found{std::vector<double>(targets.size() * dof()), std::vector<int>(targets.size())};
    if (targets.empty()) return found;
    if (!seeds.empty() && seeds.size() != targets.size()) throw Error(JACOKIN_IK_BAD_ARGUMENT);
    std::vector<double> starts;
    starts.reserve(seeds.size() * dof());
    for (const Configuration& seed : seeds) starts.insert(starts.end(), checked(seed), checked(seed) + dof());
    work.fit(*this, JACOKIN_IK_POSES);
    check(jacokin_ik_batch(get(), targets.size(), targets.front().data(), seeds.empty() ? nullptr : starts.data(),
                           work.data(), work.size(), found.q.data(), found.status.data()));
    return found;
  }

  // All configurations of a seven-joint arm at a pose, or of a six-joint arm whose tool may turn about an axis.
  SolutionSet intervals(const Pose& target, Work& work, const Axis* about = nullptr) const {
    SolutionSet found{std::vector<Interval>(JACOKIN_IK_MAX_INTERVALS), 0, false};
    int count = 0, complete = 0;
    work.fit(*this, JACOKIN_IK_INTERVALS);
    found.status = check(jacokin_ik_intervals(get(), target.data(), about, work.data(), work.size(),
                                              found.intervals.data(), JACOKIN_IK_MAX_INTERVALS, &count, &complete));
    found.intervals.resize(static_cast<std::size_t>(count));
    found.complete = complete != 0;
    return found;
  }

  // The configuration of an interval at a parameter [rad]; `work` is as intervals() left it.
  std::optional<Configuration> at(const Interval& interval, double parameter, const Configuration& seed,
                                  Work& work) const {
    Configuration q(dof());
    const int found =
        check(jacokin_ik_at(get(), work.data(), work.size(), &interval, parameter, checked(seed), q.data()));
    return found == JACOKIN_IK_OK ? std::optional<Configuration>(q) : std::nullopt;
  }

  // The configuration of all intervals that is nearest to the seed; nothing where there is none. `status` says why.
  std::optional<Solution> nearest_about(const Pose& target, const Configuration& seed, Work& work,
                                      const Axis* about = nullptr, int* status = nullptr) const {
    Solution found{Configuration(dof()), 0.0};
    work.fit(*this, JACOKIN_IK_INTERVALS);
    const int done = check(jacokin_ik_nearest_about(get(), target.data(), about, checked(seed), work.data(),
                                                    work.size(), found.q.data(), &found.parameter));
    if (status != nullptr) *status = done;
    return done == JACOKIN_IK_OK ? std::optional<Solution>(found) : std::nullopt;
  }

  const jacokin_ik_solver* get() const { return solver_.get(); }

 private:
  struct Free {
    void operator()(jacokin_ik_solver* solver) const { jacokin_ik_free(solver); }
  };

  static int check(int status) {
    if (status < 0) throw Error(status);
    return status;
  }

  const double* checked(const Configuration& q) const {
    if (q.size() != dof()) throw Error(JACOKIN_IK_BAD_ARGUMENT);
    return q.data();
  }

  Configuration limits(int which) const {
    Configuration values(dof());
    check(jacokin_ik_limits(get(), which == 0 ? values.data() : nullptr, which == 1 ? values.data() : nullptr,
                            which == 2 ? values.data() : nullptr));
    return values;
  }

  std::unique_ptr<jacokin_ik_solver, Free> solver_;
};

inline Work::Work(const Solver& solver, jacokin_ik_task task) { fit(solver, task); }

inline void Work::fit(const Solver& solver, jacokin_ik_task task) {
  const std::size_t needed = jacokin_ik_work_size(solver.get(), task);
  if (size() < needed) memory_.resize((needed + sizeof(double) - 1) / sizeof(double));
}

}  // namespace jacokin
