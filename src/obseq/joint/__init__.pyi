from .adjustment import Adjustment as Adjustment
from .solution import JointSolution as JointSolution
