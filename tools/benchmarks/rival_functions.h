// The functions that the rival's text calls, as the original defines them; here they can all be inlined.
#include <cmath>
#include <vector>

template <class T> inline T square(const T &a) { return a * a; }
template <class T> inline T cube(const T &a) { return a * a * a; }
template <class T> inline T pow4(const T &a) { return square(square(a)); }
template <class T> inline T pow5(const T &a) { return a * pow4(a); }
template <class T> inline T pow6(const T &a) { return square(cube(a)); }
template <class T> inline T pow7(const T &a) { return a * pow6(a); }

using std::acos;
using std::atan;
using std::cos;
using std::exp;
using std::log;
using std::pow;
using std::sin;
using std::sqrt;
using std::tan;

inline double ATan2(double x, double y) { return std::atan2(x, y); }
inline double DerX_ATan2(double x, double y) { return y / (x * x + y * y); }
inline double DerY_ATan2(double x, double y) { return -x / (x * x + y * y); }

inline double DiffAngMod(double a, double b)
{
    double difference = a - b;
    if (difference < -M_PI)
        difference += 2 * M_PI * std::floor((M_PI - difference) / (2 * M_PI));
    else if (difference > 2 * M_PI)
        difference -= 2 * M_PI * std::floor((M_PI + difference) / (2 * M_PI));
    return difference;
}
inline double DerA_DiffAngMod(double, double) { return 1.0; }
inline double DerB_DiffAngMod(double, double) { return -1.0; }

inline double ASin(double x) { return std::asin(x); }
inline double DerASin(double x) { return 1.0 / std::sqrt(1.0 - x * x); }
inline double DerACos(double x) { return -1.0 / std::sqrt(1.0 - x * x); }
inline double DerATan(double x) { return 1.0 / (1.0 + x * x); }
inline double DerTan(double x) { return 1.0 + square(std::tan(x)); }

inline double sinC(double x)
{
    if (std::abs(x) < 1e-4)
        return 1.0 - square(x) / 6.0;
    return std::sin(x) / x;
}
inline double DerSinC(double x)
{
    if (std::abs(x) < 1e-4)
        return -x / 3.0;
    return (x * std::cos(x) - std::sin(x)) / square(x);
}

inline double AtanXsY_sX(double x, double y)
{
    if (std::abs(x) < 1e-4 * std::abs(y))
        return 1.0 / y - square(x) / (3.0 * cube(y));
    return std::atan2(x, y) / x;
}
inline double DerXAtanXsY_sX(double x, double y)
{
    if (std::abs(x) < 1e-4 * std::abs(y))
        return -2.0 * x / (3.0 * cube(y));
    return y / (x * (square(x) + square(y))) - std::atan2(x, y) / square(x);
}
inline double DerYAtanXsY_sX(double x, double y) { return -1.0 / (square(x) + square(y)); }

inline double NormalisedRatioPos(double a, double b)
{
    a = a > 0.0 ? a : 0.0;
    b = b > 0.0 ? b : 0.0;
    if (a < b)
        return a / b - 1.0;
    return a > b ? 1.0 - b / a : 0.0;
}
inline double DerA_NormalisedRatioPos(double a, double b)
{
    if (a < 0.0 || (a == 0.0 && b <= 0.0))
        return 0.0;
    return a < b ? 1.0 / b : b / square(a);
}
inline double DerB_NormalisedRatioPos(double a, double b) { return -DerA_NormalisedRatioPos(b, a); }
