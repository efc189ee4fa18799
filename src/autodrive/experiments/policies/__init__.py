"""Policies: networks that drive a car, in one file, without the library that trained them."""

from autodrive.experiments.policies.policy import Pace as Pace
from autodrive.experiments.policies.policy import Policy as Policy
from autodrive.experiments.policies.policy import PolicyMemory as PolicyMemory
