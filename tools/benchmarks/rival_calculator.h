// The rival's calculator, as programs meet the original's: arguments come in vectors that are checked and copied
// to the slots of a buffer, the generated loop runs over the slots, and results are lines that are recycled.
#include <algorithm>
#include <stdexcept>
#include <vector>

using Vector = std::vector<double>;

struct Calculator {
    Calculator(std::size_t capacity, std::size_t n_unknowns, std::size_t n_observations, std::size_t n_results)
        : mCapacity(capacity), mNbUk(n_unknowns), mNbObs(n_observations),
          mBufLineRes(capacity, Vector(n_results)), mVUk(capacity, Vector(n_unknowns)),
          mVObs(capacity, Vector(n_observations))
    {
        mLines.reserve(capacity);
    }
    virtual ~Calculator() {}

    void Push(const Vector &unknowns, const Vector &observations)
    {
        if (mNbInBuf >= mCapacity)
            throw std::length_error("the buffer is full");
        if (unknowns.size() != mNbUk)
            throw std::length_error("wrong number of unknowns");
        if (observations.size() != mNbObs)
            throw std::length_error("wrong number of observations");
        SetUnknowns(unknowns);
        SetObservations(observations);
        mNbInBuf++;
    }

    const std::vector<Vector *> &EvaluateAndClear()
    {
        mLines.clear();
        DoEval();
        for (std::size_t k = 0; k < mNbInBuf; k++)
            mLines.push_back(&mBufLineRes[k]);
        mNbInBuf = 0;
        return mLines;
    }

    virtual void DoEval() = 0;
    virtual void SetUnknowns(const Vector &values)
    {
        for (std::size_t i = 0; i < mNbUk; i++)
            mVUk[mNbInBuf][i] = values[i];
    }
    virtual void SetObservations(const Vector &values)
    {
        for (std::size_t i = 0; i < mNbObs; i++)
            mVObs[mNbInBuf][i] = values[i];
    }

    std::size_t mCapacity, mNbUk, mNbObs, mNbInBuf = 0;
    std::vector<Vector> mBufLineRes, mVUk, mVObs;
    std::vector<Vector *> mLines;
};
