// Drives where the way is free, by the LIDAR alone; where there is none it goes back, and turns.
//
//   roslaunch autodrive_ros follow_the_gap.launch      (with the simulator on: autodrive run mini_map --mode autonomous)
//
// At each scan: for some headings, how far could the car go that way before it touched something? The best of them,
// where a turn costs a little, is steered at; the shorter the way, the slower the car. (What is lower than the LIDAR,
// like a single construction box, it does not see.)

#include <algorithm>
#include <cmath>
#include <vector>

#include <ros/ros.h>
#include <sensor_msgs/LaserScan.h>
#include <std_msgs/Float32.h>

namespace {

constexpr double kHalfWidth = 0.19;        // of the way that it wants [m]; it is 0.175 m wide, and its tail cuts corners
constexpr double kStop = 0.25;             // free way at which it stands [m]; the bumper is 0.08 m ahead of the LIDAR
constexpr double kGo = 0.6;                // ... and at which it goes on again [m]
constexpr double kTail = 0.4;             // free way behind the LIDAR to go back [m]; the bumper is 0.2 m behind it
constexpr double kSlow = 1.0;              // ... and at which it need not be slow [m]
constexpr double kSight = 2.0;             // further away nothing matters [m]
constexpr double kTurnCosts = 0.3;         // free way that a turn by one radian must gain [m]
constexpr double kGain = 2.0;              // steering angle by heading: it must turn before it is there
constexpr double kSteeringLimit = 0.5236;  // [rad]
constexpr double kDegree = M_PI / 180.0;

struct Point {
  double x, y;  // from the LIDAR, x ahead, y to the left [m]
};

/// What the scan has hit. The first ray looks straight ahead and the next further to the left, whatever the angles of
/// the scan's own frame, which is turned on this car.
std::vector<Point> hits(const sensor_msgs::LaserScan& scan) {
  std::vector<Point> points;
  for (std::size_t i = 0; i < scan.ranges.size(); ++i) {
    const double angle = i * scan.angle_increment;
    double range = scan.ranges[i];
    if (std::isinf(range) && range < 0.0) range = scan.range_min;  // too near to measure (REP 117)
    if (std::isfinite(range)) points.push_back({range * std::cos(angle), range * std::sin(angle)});
  }
  return points;
}

/// How far the car could go straight on in that heading [rad, left positive].
double free_way(const std::vector<Point>& points, double heading) {
  const double c = std::cos(heading), s = std::sin(heading);
  double free = kSight;
  for (const auto& [x, y] : points) {
    const double ahead = c * x + s * y, aside = c * y - s * x;
    if (ahead > 0.0 && std::abs(aside) < kHalfWidth) free = std::min(free, ahead);
  }
  return free;
}

class Driver {
 public:
  Driver() : left_(ros::NodeHandle("~").param("left", 1.0)), speed_(ros::NodeHandle("~").param("throttle", 0.6)) {
    throttle_ = node_.advertise<std_msgs::Float32>("throttle_command", 1);
    steering_ = node_.advertise<std_msgs::Float32>("steering_command", 1);
    scan_ = node_.subscribe("lidar", 1, &Driver::drive, this, ros::TransportHints().tcpNoDelay());
  }

 private:
  void drive(const sensor_msgs::LaserScan& scan) {
    const std::vector<Point> points = hits(scan);
    double best = 0.0, gain = -1.0;
    for (double heading = -70.0 * kDegree; heading <= 70.0 * kDegree; heading += 2.0 * kDegree) {
      const double worth = free_way(points, heading) - kTurnCosts * std::abs(heading);
      if (worth > gain) best = heading, gain = worth;
    }
    const double way = free_way(points, best);
    is_stuck_ = way < (is_stuck_ ? kGo : kStop);
    std_msgs::Float32 throttle, steering;
    throttle.data = speed_ * std::clamp(way / kSlow, 0.4, 1.0);
    steering.data = left_ * std::clamp(kGain * best / kSteeringLimit, -1.0, 1.0);
    if (is_stuck_) {  // back, with the wheels the other way; a throttle of 0 brakes
      throttle.data = free_way(points, M_PI) > kTail ? -0.5 * speed_ : 0.0;
      steering.data = best < 0.0 ? left_ : -left_;
    }
    throttle_.publish(throttle);
    steering_.publish(steering);
  }

  ros::NodeHandle node_;
  ros::Publisher throttle_, steering_;
  ros::Subscriber scan_;
  bool is_stuck_ = false;
  double left_;   // sign of a steering command to the left: -1 with the names of 2020 and 2022
  double speed_;  // throttle where the way is free
};

}  // namespace

int main(int argc, char** argv) {
  ros::init(argc, argv, "follow_the_gap");
  Driver driver;
  ros::spin();
}
