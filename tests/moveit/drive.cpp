// Drives the plugin through the interface of MoveIt, as its planners do. Prints solutions for the test to compare.
//
//     drive FILE

#include <algorithm>
#include <chrono>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <limits>
#include <memory>
#include <string>
#include <thread>
#include <vector>

#include <moveit/kinematics_base/kinematics_base.hpp>

#include "jacokin_ik.hpp"

std::unique_ptr<kinematics::KinematicsBase> make_plugin();

namespace {

using Code = moveit_msgs::msg::MoveItErrorCodes;
using Message = geometry_msgs::msg::Pose;
using kinematics::DiscretizationMethods::ALL_DISCRETIZED;
using kinematics::DiscretizationMethods::ALL_RANDOM_SAMPLED;
using Callback = kinematics::KinematicsBase::IKCallbackFn;

void check(bool fine, const char* what, int line) {
  if (fine) return;
  std::fprintf(stderr, "line %d: %s\n", line, what);
  std::exit(1);
}

#define CHECK(condition) check(condition, #condition, __LINE__)

struct Bench {
  explicit Bench(const std::string& file) : arm(file), model(std::make_shared<moveit::core::RobotModel>()) {
    const auto lower = arm.lower(), upper = arm.upper();
    joints.resize(arm.dof());
    for (std::size_t j = 0; j < arm.dof(); ++j) {
      joints[j].bounds = {{lower[j], upper[j], std::isfinite(lower[j])}};
      model->group.names.push_back("j2_" + arm.joint_names()[j]);
      model->group.joints.push_back(&joints[j]);
    }
    model->forward = [this](const std::vector<double>& q) { return arm.forward(q); };
    node->values[parameter] = file;
  }

  bool initialize(kinematics::KinematicsBase& plugin) const {
    return plugin.initialize(node, *model, "arm", "base", {"tip"}, 0.2);
  }

  const std::string parameter = "robot_description_kinematics.arm.jacokin_solver_file";
  jacokin::Solver arm;
  std::vector<moveit::core::JointModel> joints;
  std::shared_ptr<moveit::core::RobotModel> model;
  rclcpp::Node::SharedPtr node = std::make_shared<rclcpp::Node>();
};

double distance(const std::vector<double>& a, const std::vector<double>& b) {
  double square = 0.0;
  for (std::size_t j = 0; j < a.size(); ++j) square += (a[j] - b[j]) * (a[j] - b[j]);
  return std::sqrt(square);
}

bool reaches(const Bench& bench, const std::vector<double>& q, const std::vector<double>& goal) {
  const auto a = bench.arm.forward(q), b = bench.arm.forward(goal);
  for (std::size_t i = 0; i < 16; ++i)
    if (!(std::abs(a[i] - b[i]) < 1e-6)) return false;
  return true;
}

void check_refusals(const std::string& file) {
  auto plugin = make_plugin();
  std::vector<double> solution;
  std::vector<std::vector<double>> solutions;
  kinematics::KinematicsResult result{};
  Code code;
  CHECK(!plugin->getPositionIK(Message(), {}, solution, code));
  CHECK(!plugin->getPositionIK({Message()}, {}, solutions, result, {}));
  CHECK(result.kinematic_error == kinematics::KinematicErrors::SOLVER_NOT_ACTIVE);

  Bench no_file(file);
  no_file.node->values[no_file.parameter] = "/nowhere";
  CHECK(!no_file.initialize(*plugin));
  Bench other_tool(file);
  other_tool.model->forward = [&](const std::vector<double>& q) {
    auto pose = other_tool.arm.forward(q);
    pose[11] += 0.001;
    return pose;
  };
  CHECK(!other_tool.initialize(*plugin));
  Bench other_names(file);
  other_names.model->group.names[1] = "elbow";
  CHECK(!other_names.initialize(*plugin));
  Bench fewer(file);
  fewer.model->group.names.pop_back();
  CHECK(!fewer.initialize(*plugin));
  CHECK(!plugin->initialize(fewer.node, *fewer.model, "hand", "base", {"tip"}, 0.1));
  CHECK(!plugin->initialize(fewer.node, *fewer.model, "arm", "base", {"tip", "tip2"}, 0.1));
}

void check_search(const Bench& bench, const kinematics::KinematicsBase& plugin, const std::vector<double>& goal,
                  const Message& pose) {
  std::vector<double> solution, seed = goal;
  Code code;
  for (std::size_t j = 0; j < seed.size(); ++j) seed[j] += j % 2 == 0 ? 0.02 : -0.01;
  CHECK(plugin.getPositionIK(pose, seed, solution, code));
  CHECK(code.val == Code::SUCCESS && reaches(bench, solution, goal));
  CHECK(distance(solution, seed) <= distance(goal, seed) + 1e-9);
  const std::vector<double> nearest = solution;

  // Consistency limits: the nearest one is inside wide ones, nothing inside narrow ones.
  CHECK(plugin.searchPositionIK(pose, seed, 0.1, std::vector<double>(seed.size(), 0.05), solution, code));
  CHECK(solution == nearest);
  CHECK(!plugin.searchPositionIK(pose, seed, 0.1, std::vector<double>(seed.size(), 1e-4), solution, code));
  CHECK(code.val == Code::NO_IK_SOLUTION && solution.empty());
  CHECK(!plugin.searchPositionIK(pose, seed, 0.1, std::vector<double>(2, 0.1), solution, code));

  // A callback that refuses the nearest two gets the third one, farther away.
  std::vector<std::vector<double>> offered;
  const Callback third = [&offered](const Message&, const std::vector<double>& q, Code& answer) {
    offered.push_back(q);
    answer.val = offered.size() < 3 ? Code::NO_IK_SOLUTION : Code::SUCCESS;
  };
  CHECK(plugin.searchPositionIK(pose, seed, 5.0, solution, third, code));
  CHECK(offered.size() == 3 && solution == offered[2] && offered[0] == nearest);
  CHECK(distance(offered[0], seed) <= distance(offered[1], seed) && distance(offered[1], seed) <= distance(offered[2], seed));
  CHECK(reaches(bench, offered[2], goal));
  CHECK(offered[1] != offered[0]);

  // A slow callback that refuses everything runs into the timeout.
  const Callback slow = [](const Message&, const std::vector<double>&, Code& answer) {
    std::this_thread::sleep_for(std::chrono::milliseconds(20));
    answer.val = Code::NO_IK_SOLUTION;
  };
  CHECK(!plugin.searchPositionIK(pose, seed, 0.01, {}, solution, slow, code));
  CHECK(code.val == Code::TIMED_OUT);

  Message far = pose;
  far.position.x = 5.0;
  CHECK(!plugin.getPositionIK(far, seed, solution, code) && code.val == Code::NO_IK_SOLUTION);
  Message bad = pose;
  bad.orientation.w = std::numeric_limits<double>::quiet_NaN();
  CHECK(!plugin.getPositionIK(bad, seed, solution, code));
  CHECK(!plugin.getPositionIK(pose, {0.0}, solution, code));
}

// The least time of some calls [s].
template <typename Call>
double quickest(const Call& call) {
  double least = std::numeric_limits<double>::infinity();
  for (int i = 0; i < 20; ++i) {
    const auto start = std::chrono::steady_clock::now();
    call();
    least = std::min(least, std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count());
  }
  return least;
}

// The nearest configuration costs through the plugin about what it costs in the library, of seven joints too.
void check_quickness(const Bench& bench, const kinematics::KinematicsBase& plugin, const std::vector<double>& goal,
                     const Message& pose) {
  std::vector<double> solution, seed = goal;
  for (std::size_t j = 0; j < seed.size(); ++j) seed[j] += j % 2 == 0 ? 0.02 : -0.01;
  jacokin::Work work;
  const jacokin::Pose target = bench.arm.forward(goal);
  const double library = quickest([&] { CHECK(bench.arm.nearest(target, seed, work).has_value()); });
  Code code;
  const double through = quickest([&] { CHECK(plugin.getPositionIK(pose, seed, solution, code)); });
  const auto nearest = bench.arm.nearest(target, seed, work);
  for (std::size_t j = 0; j < seed.size(); ++j) CHECK(std::abs(solution[j] - (*nearest)[j]) < 1e-6);
  std::fprintf(stderr, "%zu joints: %.1f us in the library, %.1f us through the plugin\n", seed.size(), 1e6 * library,
               1e6 * through);
  CHECK(through < 3.0 * library + 50e-6);
}

void print_all(const Bench& bench, const kinematics::KinematicsBase& plugin, const std::vector<double>& goal,
               const Message& pose) {
  std::vector<std::vector<double>> held, all;
  kinematics::KinematicsResult result{};
  kinematics::KinematicsQueryOptions options;
  CHECK(plugin.getPositionIK({pose}, goal, held, result, options));
  CHECK(result.kinematic_error == kinematics::KinematicErrors::OK);
  CHECK(result.solution_percentage > 0.0 && result.solution_percentage <= 1.0);
  options.discretization_method = ALL_DISCRETIZED;
  CHECK(plugin.getPositionIK({pose}, goal, all, result, options));
  CHECK(bench.arm.dof() == 6 ? all == held : all.size() > 3 * held.size());
  for (const auto& rows : {held, all})
    for (const auto& q : rows) CHECK(reaches(bench, q, goal));
  if (bench.arm.dof() == 7)
    for (const auto& q : held) CHECK(std::abs(std::remainder(q[2] - goal[2], 2.0 * 3.141592653589793)) < 1e-9);
  options.discretization_method = ALL_RANDOM_SAMPLED;
  CHECK(!plugin.getPositionIK({pose}, goal, all, result, options));
  CHECK(result.kinematic_error == kinematics::KinematicErrors::UNSUPORTED_DISCRETIZATION_REQUESTED);
  CHECK(!plugin.getPositionIK({}, goal, all, result, {}));
  CHECK(!plugin.getPositionIK({pose, pose}, goal, all, result, {}));
  CHECK(result.kinematic_error == kinematics::KinematicErrors::MULTIPLE_TIPS_NOT_SUPPORTED);
  for (const auto& q : held) {
    for (double angle : q) std::printf("%.17g ", angle);
    std::printf("\n");
  }
}

}  // namespace

int main(int argc, char** argv) {
  if (argc != 2) return 2;
  check_refusals(argv[1]);
  const Bench bench(argv[1]);
  auto plugin = make_plugin();
  CHECK(bench.initialize(*plugin));
  CHECK(plugin->getJointNames() == bench.model->group.names);
  const bool seven = bench.arm.dof() == 7;
  CHECK(plugin->setRedundantJoints(std::vector<unsigned int>{2}) == seven);
  CHECK(!plugin->setRedundantJoints(std::vector<unsigned int>{1}));
  CHECK(plugin->setRedundantJoints(std::vector<std::string>{"j2_joint_3"}) == seven);

  const std::vector<double> goal = bench.arm.home();
  std::vector<Message> poses;
  CHECK(plugin->getPositionFK({"tip"}, goal, poses) && poses.size() == 1);
  CHECK(!plugin->getPositionFK({"elbow"}, goal, poses) && poses.empty());
  CHECK(plugin->getPositionFK({"tip"}, goal, poses));
  check_search(bench, *plugin, goal, poses[0]);
  check_quickness(bench, *plugin, goal, poses[0]);
  print_all(bench, *plugin, goal, poses[0]);

  // Bounds of the robot model that are narrower than the exported ones count, too.
  Bench narrow(argv[1]);
  narrow.joints[0].bounds = {{goal[0] - 1e-3, goal[0] + 1e-3, true}};
  auto other = make_plugin();
  CHECK(narrow.initialize(*other));
  kinematics::KinematicsResult result{};
  std::vector<std::vector<double>> solutions;
  CHECK(other->getPositionIK({poses[0]}, goal, solutions, result, {}));
  for (const auto& q : solutions) CHECK(std::abs(q[0] - goal[0]) <= 1e-3);

  // So they do where the copy nearest to the seed is outside of them, and one a turn away inside.
  std::vector<double> wound = goal;
  wound[0] += 4.0;
  CHECK(other->getPositionIK({poses[0]}, wound, solutions, result, {}));
  for (const auto& q : solutions) CHECK(std::abs(q[0] - goal[0]) <= 1e-3 && reaches(narrow, q, goal));
  for (std::size_t i = 1; i < solutions.size(); ++i) CHECK(distance(solutions[i - 1], wound) <= distance(solutions[i], wound));
  return 0;
}
