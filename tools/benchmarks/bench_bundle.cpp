// Bundle adjustment of a BAL file by Ceres, one thread: what bench_bundle.py times ours against.
// Usage: bench_bundle FILE ITERATIONS; prints CPU seconds of all iterations, their number, initial and final cost.

#include <ceres/ceres.h>
#include <ceres/rotation.h>
#include <glog/logging.h>

#include <cstdio>
#include <cstdlib>
#include <ctime>
#include <vector>

struct Pixel {
    double x, y;

    template <typename T>
    bool operator()(const T* camera, const T* point, T* residuals) const {
        T seen[3];
        ceres::AngleAxisRotatePoint(camera, point, seen);
        for (int i = 0; i < 3; ++i) seen[i] += camera[3 + i];
        const T u = -seen[0] / seen[2], v = -seen[1] / seen[2], square = u * u + v * v;
        const T scale = camera[6] * (1.0 + square * (camera[7] + camera[8] * square));
        residuals[0] = scale * u - x;
        residuals[1] = scale * v - y;
        return true;
    }
};

struct Observation {
    int camera, point;
    double x, y;
};

static double solved(const std::vector<Observation>& observations, std::vector<double> unknowns, int n_cameras,
                     int iterations, ceres::Solver::Summary* summary) {
    ceres::Problem problem;
    double* points = unknowns.data() + 9 * n_cameras;
    ceres::Solver::Options options;
    options.linear_solver_ordering = std::make_shared<ceres::ParameterBlockOrdering>();
    for (const Observation& o : observations) {
        double *camera = unknowns.data() + 9 * o.camera, *point = points + 3 * o.point;
        auto* cost = new ceres::AutoDiffCostFunction<Pixel, 2, 9, 3>(new Pixel{o.x, o.y});
        problem.AddResidualBlock(cost, nullptr, camera, point);
        options.linear_solver_ordering->AddElementToGroup(point, 0);
        options.linear_solver_ordering->AddElementToGroup(camera, 1);
    }
    options.linear_solver_type = ceres::DENSE_SCHUR;
    options.max_num_iterations = iterations;
    options.function_tolerance = 1e-14;
    options.num_threads = 1;
    const std::clock_t start = std::clock();
    ceres::Solve(options, &problem, summary);
    return double(std::clock() - start) / CLOCKS_PER_SEC;
}

int main(int, char** arguments) {
    google::InitGoogleLogging(arguments[0]);
    FILE* file = std::fopen(arguments[1], "r");
    int n_cameras, n_points, n;
    if (!file || std::fscanf(file, "%d %d %d", &n_cameras, &n_points, &n) != 3) return 1;
    std::vector<Observation> observations(n);
    for (Observation& o : observations)
        if (std::fscanf(file, "%d %d %lf %lf", &o.camera, &o.point, &o.x, &o.y) != 4) return 1;
    std::vector<double> unknowns(9 * n_cameras + 3 * n_points);
    for (double& value : unknowns)
        if (std::fscanf(file, "%lf", &value) != 1) return 1;
    ceres::Solver::Summary before, after;
    const double setup = solved(observations, unknowns, n_cameras, 0, &before);
    const double seconds = solved(observations, unknowns, n_cameras, std::atoi(arguments[2]), &after) - setup;
    const int done = after.num_successful_steps + after.num_unsuccessful_steps - 1;
    std::printf("%.9f %d %.12g %.12g\n", seconds, done, after.initial_cost, after.final_cost);
}
