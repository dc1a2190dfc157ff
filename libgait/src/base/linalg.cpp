/* The only file that sees Eigen: fixed sizes, so no heap; linked by the C compiler, so no C++ run time. */
#include "base/linalg.h"

#include <Eigen/SVD>

/* Singular vectors, not SelfAdjointEigenSolver: of a positive semidefinite matrix they are the eigenvectors,
 * and Eigen's eigen-solver refers to free() even at a fixed size. */
extern "C" void la_rotation_mean(const double sum_qq[16], float q[4])
{
    Eigen::JacobiSVD<Eigen::Matrix4d, Eigen::NoQRPreconditioner> const svd(
        Eigen::Map<const Eigen::Matrix4d>{sum_qq}, Eigen::ComputeFullU);
    Eigen::Vector4d const v = svd.matrixU().col(0); /* singular values descend */
    int first = 0;
    while (first < 3 && v[first] == 0.0)
        first++;
    double const sign = v[first] < 0.0 ? -1.0 : 1.0;
    for (int i = 0; i < 4; i++)
        q[i] = static_cast<float>(sign * v[i]);
}
