// The rival of tools/benchmarks/bench_assembly.py: normal equations built one observation at a time, as MMVII does it
// (cResolSysNonLinear::CalcVal and AddObs, cSparseLeasSqtAA; src/Matrix), rewritten with its copies and
// allocations and without what its solve does afterwards. Per observation: index and observation vectors
// made by the caller, arguments gathered in a vector, pushed in the calculator and evaluated (DoOneEval,
// buffer of one), values, derivatives and weights copied in a record, constraints substituted through a dense
// scratch vector, then per residual a sparse vector that is added to the system with its bookkeeping.
// The sparse system keeps equations in a buffer and pours it, row by row through a dense scratch row, when it holds
// four coefficients per unknown; the dense one adds to the upper triangle at once.

#include <cmath>
#include <cstdint>
#include <ctime>
#include <memory>
#include <utility>
#include <vector>

using Vector = std::vector<double>;
using Indexes = std::vector<int>;

class Calculator {
 public:
  Calculator(int unknowns, int observations)
      : unknowns_(1, Vector(unknowns)), observations_(1, Vector(observations)) {
    lines_.push_back(std::make_unique<Vector>(1 + unknowns));
  }
  virtual ~Calculator() = default;

  const Vector& DoOneEval(const Vector& unknowns, const Vector& observations) {
    for (size_t k = 0; k < unknowns.size(); k++) unknowns_.at(pending_)[k] = unknowns[k];
    for (size_t k = 0; k < observations.size(); k++) observations_.at(pending_)[k] = observations[k];
    pending_++;
    return *EvalAndClear()[0];
  }

 protected:
  virtual void DoEval() = 0;
  const std::vector<Vector*>& EvalAndClear() {
    results_.clear();
    for (int k = 0; k < pending_; k++) results_.push_back(lines_[k].get());
    DoEval();
    pending_ = 0;
    return results_;
  }
  int pending_ = 0;
  std::vector<Vector> unknowns_, observations_;
  std::vector<std::unique_ptr<Vector>> lines_;
  std::vector<Vector*> results_;
};

class Dist3D : public Calculator {
 public:
  Dist3D() : Calculator(6, 1) {}

 private:
  void DoEval() override {
    for (int k = 0; k < pending_; k++) {
      const Vector& u = unknowns_[k];
      Vector& out = *lines_[k];
      double dx = u[3] - u[0], dy = u[4] - u[1], dz = u[5] - u[2];
      double d = std::sqrt(dx * dx + dy * dy + dz * dz);
      out[0] = d - observations_[k][0];
      out[1] = -dx / d;
      out[2] = -dy / d;
      out[3] = -dz / d;
      out[4] = dx / d;
      out[5] = dy / d;
      out[6] = dz / d;
    }
  }
};

class TopoHz : public Calculator {
 public:
  TopoHz() : Calculator(9, 10) {}

 private:
  void DoEval() override {
    for (int k = 0; k < pending_; k++) {
      const Vector& u = unknowns_[k];
      const Vector& m = observations_[k];  // rotation column by column, then the direction
      Vector& out = *lines_[k];
      double dx = u[6] - u[0], dy = u[7] - u[1], dz = u[8] - u[2];
      double lx = m[0] * dx + m[1] * dy + m[2] * dz;
      double ly = m[3] * dx + m[4] * dy + m[5] * dz;
      double lz = m[6] * dx + m[7] * dy + m[8] * dz;
      double x = lx - u[5] * ly + u[4] * lz;
      double y = u[5] * lx + ly - u[3] * lz;
      double q = x * x + y * y, gx = y / q, gy = -x / q;
      double ax = gx + u[5] * gy, ay = gy - u[5] * gx, az = u[4] * gx - u[3] * gy;
      double tx = ax * m[0] + ay * m[3] + az * m[6];
      double ty = ax * m[1] + ay * m[4] + az * m[7];
      double tz = ax * m[2] + ay * m[5] + az * m[8];
      double difference = std::atan2(x, y) - m[9];
      if (difference < -M_PI) difference += 2 * M_PI;
      if (difference > M_PI) difference -= 2 * M_PI;
      out[0] = difference;
      out[1] = -tx;
      out[2] = -ty;
      out[3] = -tz;
      out[4] = -gy * lz;
      out[5] = gx * lz;
      out[6] = gy * lx - gx * ly;
      out[7] = tx;
      out[8] = ty;
      out[9] = tz;
    }
  }
};

using SparseVector = std::vector<std::pair<int, double>>;

struct Record {  // cInputOutputRSNL
  Indexes indexes;
  Vector observations, weights, values;
  std::vector<Vector> derivatives;
};

class Weighter {
 public:
  explicit Weighter(double weight) : weight_(weight) {}
  virtual ~Weighter() = default;
  virtual Vector WeightOfResidual(const Vector& residuals) const { return Vector(residuals.size(), weight_); }

 private:
  double weight_;
};

class LinearSystem {
 public:
  explicit LinearSystem(int n) : n_(n), rhs_(n, 0.0), lvm_(n, 0.0), sums_(n, 0.0) {}
  virtual ~LinearSystem() = default;
  void PublicAddObservation(double weight, const SparseVector& coefficients, double rhs) {
    if (weight == 0) return;
    rows_ += 1;
    squares_ += weight * rhs * rhs;
    for (const auto& [i, c] : coefficients) {
      lvm_[i] += weight * c * c;
      sums_[i] += weight * rhs * c;
    }
    Add(weight, coefficients, rhs);
  }
  virtual void Add(double weight, const SparseVector& coefficients, double rhs) = 0;
  virtual void Finish() {}
  virtual double Checksum() const = 0;

 protected:
  int n_;
  double rows_ = 0, squares_ = 0;
  Vector rhs_, lvm_, sums_;
};

class DenseSystem : public LinearSystem {
 public:
  explicit DenseSystem(int n) : LinearSystem(n), matrix_(static_cast<size_t>(n) * n, 0.0) {}
  void Add(double weight, const SparseVector& coefficients, double rhs) override {
    for (const auto& [i, c] : coefficients) {
      double scaled = c * weight;
      rhs_[i] += scaled * rhs;
      for (const auto& [j, d] : coefficients)
        if (j >= i) matrix_[static_cast<size_t>(i) * n_ + j] += scaled * d;
    }
  }
  double Checksum() const override {
    double total = 0;
    for (double value : matrix_) total += value * value;
    return total;
  }

 private:
  Vector matrix_;
};

class SparseSystem : public LinearSystem {
 public:
  explicit SparseSystem(int n) : LinearSystem(n), matrix_(n), buffered_(n), scratch_(n, 0.0), touched_(n, 0) {}
  void Add(double weight, const SparseVector& coefficients, double rhs) override {
    for (const auto& [i, c] : coefficients) {
      rhs_[i] += weight * c * rhs;
      buffered_[i].push_back({static_cast<int>(equations_.size()), c});
    }
    equations_.push_back({weight, coefficients});
    stored_ += coefficients.size();
    if (stored_ > 4u * n_) Finish();
  }
  void Finish() override {
    for (int i = 0; i < n_; i++)
      if (!buffered_[i].empty()) PourRow(i);
    equations_.clear();
    stored_ = 0;
  }
  double Checksum() const override {
    double total = 0;
    for (const auto& row : matrix_)
      for (const auto& entry : row) total += entry.second * entry.second;
    return total;
  }

 private:
  void PourRow(int i) {
    columns_.clear();
    for (const auto& [j, value] : matrix_[i]) Touch(j, value);
    for (const auto& [equation, c] : buffered_[i]) {
      double scaled = c * equations_[equation].first;
      for (const auto& [j, d] : equations_[equation].second)
        if (j >= i) Touch(j, scaled * d);
    }
    matrix_[i].clear();
    for (int j : columns_) {
      matrix_[i].push_back({j, scratch_[j]});
      scratch_[j] = 0;
      touched_[j] = 0;
    }
    buffered_[i].clear();
  }
  void Touch(int j, double value) {
    if (!touched_[j]) {
      touched_[j] = 1;
      columns_.push_back(j);
    }
    scratch_[j] += value;
  }
  std::vector<SparseVector> matrix_, buffered_;
  std::vector<std::pair<double, SparseVector>> equations_;
  size_t stored_ = 0;
  Vector scratch_;
  std::vector<char> touched_;
  Indexes columns_;
};

class Solver {  // cResolSysNonLinear
 public:
  Solver(const double* values, int n, LinearSystem& system)
      : values_(values, values + n), scratch_(n, 0.0), used_(n, 0), system_(system) {}

  void CalcAndAddObs(Calculator& calculator, const Indexes& indexes, const Vector& observations,
                     const Weighter& weighter) {
    std::vector<Record> records(1);
    CalcVal(calculator, records, indexes, observations, weighter);
    AddObs(records);
  }

 private:
  void CalcVal(Calculator& calculator, std::vector<Record>& records, const Indexes& indexes,
               const Vector& observations, const Weighter& weighter) {
    for (Record& record : records) {
      record.indexes = indexes;
      record.observations = observations;
      Vector arguments;
      for (int i : record.indexes) arguments.push_back(values_[i]);
      const Vector& line = calculator.DoOneEval(arguments, record.observations);
      record.values = {line[0]};
      record.derivatives = {Vector(line.begin() + 1, line.end())};
      record.weights = weighter.WeightOfResidual(record.values);
      Substitute(record);
    }
  }
  // No constraint is active: what remains is spreading the row in the dense scratch and collecting it again.
  void Substitute(Record& record) {
    Indexes touched;
    Vector& row = record.derivatives[0];
    for (size_t k = 0; k < row.size(); k++) {
      int i = record.indexes[k];
      scratch_[i] += row[k];
      if (!used_[i]) {
        used_[i] = 1;
        touched.push_back(i);
      }
    }
    for (size_t k = 0; k < touched.size(); k++) {
      row[k] = scratch_[touched[k]];
      scratch_[touched[k]] = 0;
      used_[touched[k]] = 0;
    }
    record.indexes = touched;
  }
  void AddObs(const std::vector<Record>& records) {
    for (const Record& record : records)
      for (size_t e = 0; e < record.values.size(); e++) {
        double weight = record.weights[e];
        if (weight <= 0) continue;
        SparseVector coefficients;
        for (size_t k = 0; k < record.indexes.size(); k++)
          if (record.derivatives[e][k] != 0) coefficients.push_back({record.indexes[k], record.derivatives[e][k]});
        system_.PublicAddObservation(weight, coefficients, -record.values[e]);
      }
  }
  Vector values_;
  Vector scratch_;
  std::vector<char> used_;
  LinearSystem& system_;
};

// indexes (n, n_blocks): first unknown of each block of three; contexts: rotations of all stations, nine each
// column by column; stations (n): rotation of each observation, or null.

extern "C" double assemble(int is_hz, int is_dense, std::int64_t n, const std::int64_t* indexes,
                           const std::int64_t* stations, const double* contexts, const double* measured,
                           double weight, const double* values, int n_unknowns, double* seconds) {
  std::unique_ptr<Calculator> calculator;
  std::unique_ptr<LinearSystem> system;
  if (is_hz) calculator = std::make_unique<TopoHz>();
  else calculator = std::make_unique<Dist3D>();
  if (is_dense) system = std::make_unique<DenseSystem>(n_unknowns);
  else system = std::make_unique<SparseSystem>(n_unknowns);
  Solver solver(values, n_unknowns, *system);
  Weighter weighter(weight);
  int blocks = is_hz ? 3 : 2;
  std::clock_t begin = std::clock();
  for (std::int64_t k = 0; k < n; k++) {
    Indexes places;
    for (int b = 0; b < blocks; b++)
      for (int i = 0; i < 3; i++) places.push_back(static_cast<int>(indexes[k * blocks + b]) + i);
    Vector observations;
    if (is_hz)
      for (int i = 0; i < 9; i++) observations.push_back(contexts[9 * stations[k] + i]);
    observations.push_back(measured[k]);
    solver.CalcAndAddObs(*calculator, places, observations, weighter);
  }
  system->Finish();
  *seconds = static_cast<double>(std::clock() - begin) / CLOCKS_PER_SEC;
  return system->Checksum();
}
