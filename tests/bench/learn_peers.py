"""Other packages on one imputation problem, run by the Python of build/peers (nothing of gait is used).

    build/peers/bin/python tests/bench/learn_peers.py PROBLEM.npz RESULT.npz METHOD COMPONENTS

PROBLEM contains `values` and `mask` (rows, phases); RESULT gets `filled`, `seconds` and `version`.
"""

import importlib
import sys
import time
import warnings
from importlib.metadata import version

import numpy as np

BASIS = (
    9  # functions of scikit-fda's Fourier basis: the four harmonics of the reference problem, in its favour
)


def iterative_imputer(values, mask, components):
    """Scikit-learn: each column by Bayesian ridge regression on the others, in turn."""
    from sklearn.experimental import enable_iterative_imputer  # noqa: F401
    from sklearn.impute import IterativeImputer

    del components
    imputer = IterativeImputer(max_iter=25, random_state=0)
    return imputer.fit_transform(np.where(mask, values, np.nan))


def fill_em(values, mask, components):
    """Statsmodels: principal components fitted to the filled data, in turn."""
    from statsmodels.multivariate.pca import PCA

    data = np.where(mask, values, np.nan)
    model = PCA(data, ncomp=components, standardize=False, demean=True, missing="fill-em", max_em_iter=500)
    return model._adjusted_data


def mixed_effects_em(values, mask, components):
    """Scikit-fda: curves in a Fourier basis with random coefficients, by EM."""
    del components
    from skfda import FDataIrregular
    from skfda.representation.basis import FourierBasis
    from skfda.representation.conversion import EMMixedEffectsConverter

    rows, samples = values.shape
    phase = np.arange(samples) / samples
    start = np.concatenate([[0], np.cumsum(mask.sum(axis=1))[:-1]])
    points = np.concatenate([phase[visible] for visible in mask])
    irregular = FDataIrregular(start_indices=start, points=points[:, None], values=values[mask][:, None])
    basis = FourierBasis((0.0, 1.0), n_basis=BASIS)
    curves = EMMixedEffectsConverter(basis).fit_transform(irregular)
    return np.where(mask, values, curves(phase)[..., 0])


METHODS = {
    "sklearn IterativeImputer": ("scikit-learn", iterative_imputer),
    "statsmodels PCA fill-em": ("statsmodels", fill_em),
    "scikit-fda mixed effects, EM": ("scikit-fda", mixed_effects_em),
}
IMPORTS = {
    "scikit-learn": ("sklearn.experimental.enable_iterative_imputer", "sklearn.impute"),
    "statsmodels": ("statsmodels.multivariate.pca",),
    "scikit-fda": ("skfda.representation.conversion", "skfda.representation.basis"),
}


def main():
    problem, result, method, components = sys.argv[1:]
    data = np.load(problem)
    package, impute = METHODS[method]
    warnings.simplefilter("ignore")  # about convergence; the error is what counts
    for module in IMPORTS[package]:  # before the clock
        importlib.import_module(module)
    begun = time.perf_counter()
    filled = impute(data["values"], data["mask"], int(components))
    seconds = time.perf_counter() - begun
    np.savez(result, filled=filled, seconds=seconds, version=version(package))


if __name__ == "__main__":
    main()
