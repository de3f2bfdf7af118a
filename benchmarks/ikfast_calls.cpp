// Seconds a pose of code that OpenRAVE's IKFast generated: compiled with -DIKFAST_FILE='"generated.cpp"'.
//
// Poses are its own forward kinematics of random configurations, so that its frames do not matter.
#define IKFAST_HAS_LIBRARY
#define IKFAST_NO_MAIN
#include IKFAST_FILE

#include <algorithm>
#include <chrono>
#include <cmath>
#include <cstdio>
#include <random>
#include <vector>

int main() {
    const int poses = 1000, rounds = 10, joints = GetNumJoints();
    std::mt19937 random(0);
    std::uniform_real_distribution<double> angle(-3.14, 3.14);
    std::vector<IkReal> places(3 * poses), rotations(9 * poses), q(joints);
    for (int i = 0; i < poses; i++) {
        for (IkReal &each : q) each = angle(random);
        ComputeFk(q.data(), &places[3 * i], &rotations[9 * i]);
    }
    const std::vector<IkReal> free(std::max(GetNumFreeParameters(), 1), 0.0);
    double best = INFINITY;
    size_t found = 0;
    for (int round = 0; round < rounds; round++) {
        found = 0;
        const auto start = std::chrono::steady_clock::now();
        for (int i = 0; i < poses; i++) {
            ikfast::IkSolutionList<IkReal> solutions;
            ComputeIk(&places[3 * i], &rotations[9 * i], free.data(), solutions);
            found += solutions.GetNumSolutions();
        }
        const std::chrono::duration<double> passed = std::chrono::steady_clock::now() - start;
        best = std::min(best, passed.count() / poses);
    }
    std::printf("%.9g %.9g\n", best, static_cast<double>(found) / poses);
}
