from .adjusted import JointSolution as JointSolution
from .adjustment import Adjustment as Adjustment
