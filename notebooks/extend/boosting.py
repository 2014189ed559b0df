"""An estimator of your own: gradient-boosted trees of scikit-learn."""

from sklearn.ensemble import HistGradientBoostingClassifier

from lic_drake import SuccessEstimator, from_sklearn, register_estimator
from lic_drake.estimate.features import FeatureMap


def boosting(features: FeatureMap) -> SuccessEstimator:
    """Returns P(success) as the probability of a gradient-boosted classifier.

    Trees are flat between their steps, so that their own gradient is zero. The optimiser climbs the
    slope of the estimate averaged over 0.2 standard deviations of a feature to either side.
    """
    trees = HistGradientBoostingClassifier(max_iter=60, random_state=0)
    return from_sklearn(trees, gradient_step=0.2)


register_estimator("boosting", boosting)
