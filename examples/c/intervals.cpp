// All configurations with one free parameter, in C++17: the tool of a six-joint arm may turn about its own z axis; on a
// seven-joint arm the parameter is one of its joints.
//
//     jacokin export-c j2n6s300 --output arm
//     c++ -std=c++17 intervals.cpp -Iarm/include arm/lib/libjacokin.so -Wl,-rpath,arm/lib -o intervals
//     ./intervals arm/j2n6s300.jacokin

#include <cstdio>

#include "jacokin_ik.hpp"

int main(int argc, char** argv) try {
  const jacokin::Solver arm(argc > 1 ? argv[1] : "j2n6s300.jacokin");
  jacokin::Work work;
  const jacokin::Pose target = arm.forward(arm.home());
  const jacokin::Axis about_z = {{0.0, 0.0, 1.0}, {-3.141592653589793, 3.141592653589793}};

  const jacokin::SolutionSet found = arm.intervals(target, work, arm.dof() == 6 ? &about_z : nullptr);
  std::printf("%s: %zu intervals, %s\n", arm.robot().c_str(), found.intervals.size(),
              found.complete ? "none is missing" : "some may be missing");
  for (const jacokin::Interval& interval : found.intervals) {
    const double middle = 0.5 * (interval.start + interval.stop);
    std::printf("branch %d: %.4f to %.4f rad\n", interval.branch, interval.start, interval.stop);
    if (const auto q = arm.at(interval, middle, arm.home(), work)) {
      std::printf("  q at %.4f rad:", middle);
      for (double angle : *q) std::printf(" %.4f", angle);
      std::printf("\n");
    }
  }
  return found.intervals.empty() ? 1 : 0;
} catch (const jacokin::Error& error) {
  std::fprintf(stderr, "%s\n", error.what());
  return 2;
}
