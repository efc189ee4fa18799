"""What files say: scenarios, maps, tracks, vehicles and race rules, and the files of this package."""

from autodrive.physics.sensors.settings import SensorSettings as SensorSettings
from autodrive.scenario.scenario import DEFAULT as DEFAULT
from autodrive.scenario.scenario import FACTOR_FIELDS as FACTOR_FIELDS
from autodrive.scenario.scenario import FACTOR_LIMITS as FACTOR_LIMITS
from autodrive.scenario.scenario import MAX_BOXES as MAX_BOXES
from autodrive.scenario.scenario import MAX_VEHICLES as MAX_VEHICLES
from autodrive.scenario.scenario import NEUTRAL as NEUTRAL
from autodrive.scenario.scenario import START as START
from autodrive.scenario.scenario import BoxSpec as BoxSpec
from autodrive.scenario.scenario import RaceSpec as RaceSpec
from autodrive.scenario.scenario import Scenario as Scenario
from autodrive.scenario.scenario import ScenarioSpec as ScenarioSpec
from autodrive.scenario.scenario import TrafficSpec as TrafficSpec
from autodrive.scenario.scenario import VehiclePlacement as VehiclePlacement
from autodrive.scenario.scenario import load_scenario as load_scenario
from autodrive.scenario.scenario import with_paths_of as with_paths_of
