// Drives into the largest gap that the LIDAR sees; if there is none, reverses and turns.
//
// Start the simulator first: autodrive run mini_map --mode autonomous
// Then the bridge, and:      roslaunch autodrive_ros follow_the_gap.launch
//
// For each scan, the free distance is computed for a set of headings. The car steers to the heading with the longest
// one, minus a cost of turning, and slows down if it is short. Objects below the scan plane, for example a single
// construction box, are not seen.

#include <algorithm>
#include <cmath>
#include <vector>

#include <ros/ros.h>
#include <sensor_msgs/LaserScan.h>
#include <std_msgs/Float32.h>

namespace {

constexpr double kHalfWidth = 0.19;        // of the free path [m]; the car is 0.175 m wide, and its tail cuts corners
constexpr double kStop = 0.25;             // free distance at which the car reverses [m]; the bumper is 0.08 m ahead of the LIDAR
constexpr double kGo = 0.6;                // free distance at which it drives forward again [m]
constexpr double kTail = 0.4;             // free distance behind the LIDAR needed to reverse [m]; the bumper is 0.2 m behind it
constexpr double kSlow = 1.0;              // free distance for full speed [m]
constexpr double kSight = 2.0;             // longest free distance that is considered [m]
constexpr double kTurnCosts = 0.3;         // free distance that a turn by one radian must gain [m]
constexpr double kGain = 2.0;              // steering angle by heading: larger than 1, to turn early
constexpr double kSteeringLimit = 0.5236;  // [rad]
constexpr double kDegree = M_PI / 180.0;

struct Point {
  double x, y;  // in the LIDAR frame, x forward, y left [m]
};

/// The points of a scan. The first ray points straight ahead, the next one further left. The angles of the message are
/// not used: with profiles before 2025, its frame points backwards.
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

/// Free distance in a heading [rad, left positive].
double free_distance(const std::vector<Point>& points, double heading) {
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
    double best = 0.0, best_score = -1.0;
    for (double heading = -70.0 * kDegree; heading <= 70.0 * kDegree; heading += 2.0 * kDegree) {
      const double score = free_distance(points, heading) - kTurnCosts * std::abs(heading);
      if (score > best_score) best = heading, best_score = score;
    }
    const double distance = free_distance(points, best);
    is_stuck_ = distance < (is_stuck_ ? kGo : kStop);
    std_msgs::Float32 throttle, steering;
    throttle.data = speed_ * std::clamp(distance / kSlow, 0.4, 1.0);
    steering.data = left_ * std::clamp(kGain * best / kSteeringLimit, -1.0, 1.0);
    if (is_stuck_) {  // reverse with opposite steering; a throttle of 0 brakes
      throttle.data = free_distance(points, M_PI) > kTail ? -0.5 * speed_ : 0.0;
      steering.data = best < 0.0 ? left_ : -left_;
    }
    throttle_.publish(throttle);
    steering_.publish(steering);
  }

  ros::NodeHandle node_;
  ros::Publisher throttle_, steering_;
  ros::Subscriber scan_;
  bool is_stuck_ = false;
  double left_;   // sign of a steering command to the left: -1 with profiles before 2025
  double speed_;  // throttle at full speed
};

}  // namespace

int main(int argc, char** argv) {
  ros::init(argc, argv, "follow_the_gap");
  Driver driver;
  ros::spin();
}
