// Everything of the C++ wrapper, checked against itself; prints the batch as a table.

#include <cmath>
#include <cstdio>
#include <fstream>
#include <iterator>

#include "jacokin_ik.hpp"

static void expect(bool condition, const char* what) {
  if (condition) return;
  std::fprintf(stderr, "%s\n", what);
  std::exit(1);
}

int main(int, char** argv) {
  const jacokin::Solver arm(argv[1]);
  std::ifstream file(argv[1], std::ios::binary);
  const std::vector<char> contents((std::istreambuf_iterator<char>(file)), std::istreambuf_iterator<char>());
  expect(jacokin::Solver(contents.data(), contents.size()).robot() == arm.robot(), "a solver from memory");

  std::vector<jacokin::Pose> targets;
  std::vector<jacokin::Configuration> seeds;
  for (int i = 0; i < 20; ++i) {
    jacokin::Configuration q = arm.home();
    for (std::size_t j = 0; j < q.size(); ++j) q[j] += 0.03 * std::sin(double(i) + double(j));
    targets.push_back(arm.forward(q));
    seeds.push_back(arm.home());
  }
  targets.push_back({1, 0, 0, 5.0, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1});  // out of reach
  seeds.push_back(arm.home());

  jacokin::Work work;  // for every call
  const jacokin::Batch found = arm.batch(targets, seeds, work), at_home = arm.batch(targets, {}, work);
  expect(found.size() == 21 && found.q.size() == 21 * arm.dof(), "the sizes of a batch");
  for (std::size_t i = 0; i < found.size(); ++i) {
    int status = 0;
    const auto single = arm.nearest(targets[i], seeds[i], work, &status);
    expect(status == found.status[i] && status == at_home.status[i], "a status");
    expect(single.has_value() == found.success(i), "a success");
    if (single) expect(*single == found.configuration(i) && *single == at_home.configuration(i), "an answer");
    else expect(std::isnan(found.configuration(i).front()), "no answer");
  }
  expect(found.success(0) && !found.success(20), "what is reached");
  expect(arm.batch({}, {}, work).size() == 0, "nothing");

  const jacokin::Axis about_z = {{0.0, 0.0, 1.0}, {-3.141592653589793, 3.141592653589793}};
  const jacokin::Axis* about = arm.dof() == 6 ? &about_z : nullptr;
  jacokin::Work fresh;
  const auto solution = arm.nearest_about(targets[0], arm.home(), fresh, about);
  expect(solution && solution->q.size() == arm.dof() && std::isfinite(solution->parameter), "a solution");
  const jacokin::SolutionSet found_all = arm.intervals(targets[0], fresh, about);
  expect(!found_all.intervals.empty() && found_all.status == JACOKIN_IK_OK, "intervals");
  expect(arm.at(found_all.intervals[0], found_all.intervals[0].start, arm.home(), fresh).has_value(), "a point of one");
  jacokin::Configuration q(arm.dof());
  expect(jacokin_ik_nearest(arm.get(), targets[0].data(), nullptr, fresh.data(), fresh.size(), q.data()) == JACOKIN_IK_OK,
         "its work memory in C");

  int refused = 0;
  try { arm.batch(targets, {arm.home()}, work); } catch (const jacokin::Error& error) { refused += error.status == JACOKIN_IK_BAD_ARGUMENT; }
  try { arm.nearest(targets[0], {1.0}, work); } catch (const jacokin::Error&) { ++refused; }
  try { jacokin::Solver("nothing.jacokin"); } catch (const jacokin::Error& error) { refused += error.status == JACOKIN_IK_NO_FILE; }
  try { jacokin::Solver(contents.data(), 100); } catch (const jacokin::Error&) { ++refused; }
  expect(refused == 4, "wrong arguments");
  std::printf("%zu of %zu reached\n", std::size_t(20), found.size());
  return 0;
}
