// Bundle adjustment of a BAL file by Ceres: what bench_bundle.py times ours against.
// Usage: bench_bundle FILE ITERATIONS THREADS SOLVER, the solver "eigen", "lapack" (dense) or "sparse".
// Prints seconds of all iterations (of the processor with one thread, else of the clock), their number, initial and
// final cost, seconds of the whole, from the first residual block to the solution, bytes that were resident at most
// beyond those of the problem in memory, and then seconds from the first residual block and cost, accepted step by step.

#include <ceres/ceres.h>
#include <ceres/rotation.h>
#include <glog/logging.h>

#include <chrono>
#include <cstdio>
#include <cstdlib>
#include <ctime>
#include <fstream>
#include <string>
#include <utility>
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

// Bytes by the name of a line of /proc/self/status: VmRSS now, VmHWM at most.
static double resident(const std::string& name) {
    std::ifstream status("/proc/self/status");
    for (std::string line; std::getline(status, line);)
        if (line.compare(0, name.size(), name) == 0) return 1024.0 * std::atof(line.c_str() + name.size() + 1);
    return 0.0;
}

static double now(int threads) {
    if (threads == 1) return double(std::clock()) / CLOCKS_PER_SEC;
    return std::chrono::duration<double>(std::chrono::steady_clock::now().time_since_epoch()).count();
}

struct Trace : ceres::IterationCallback {
    int threads;
    double begin;
    std::vector<std::pair<double, double>> steps;

    ceres::CallbackReturnType operator()(const ceres::IterationSummary& summary) override {
        if (summary.iteration == 0 || summary.step_is_successful) steps.emplace_back(now(threads) - begin, summary.cost);
        return ceres::SOLVER_CONTINUE;
    }
};

static double solved(const std::vector<Observation>& observations, std::vector<double> unknowns, int n_cameras,
                     int iterations, int threads, const std::string& solver, ceres::Solver::Summary* summary,
                     double* whole, Trace* trace) {
    const double begin = now(threads);
    trace->threads = threads;
    trace->begin = begin;
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
    options.linear_solver_type = solver == "sparse" ? ceres::SPARSE_SCHUR : ceres::DENSE_SCHUR;
    if (solver == "lapack") options.dense_linear_algebra_library_type = ceres::LAPACK;
    options.max_num_iterations = iterations;
    options.function_tolerance = 1e-14;
    options.num_threads = threads;
    options.callbacks.push_back(trace);
    const double start = now(threads);
    ceres::Solve(options, &problem, summary);
    *whole = now(threads) - begin;
    return now(threads) - start;
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
    double whole = 0.0;
    const int iterations = std::atoi(arguments[2]), threads = std::atoi(arguments[3]);
    const std::string solver = arguments[4];
    const double loaded = resident("VmRSS:");
    Trace none, trace;
    const double setup = solved(observations, unknowns, n_cameras, 0, threads, solver, &before, &whole, &none);
    const double seconds =
        solved(observations, unknowns, n_cameras, iterations, threads, solver, &after, &whole, &trace) - setup;
    const int done = after.num_successful_steps + after.num_unsuccessful_steps - 1;
    std::printf("%.9f %d %.12g %.12g %.9f", seconds, done, after.initial_cost, after.final_cost, whole);
    std::printf(" %.0f", resident("VmHWM:") - loaded);
    for (const auto& [time, cost] : trace.steps) std::printf(" %.9f %.12g", time, cost);
    std::printf("\n");
}
