/// \file
/// The messages of the native protocol. SI units and radians; x forward, y left, z up; left turns are positive. None is
/// an empty `std::optional`. See `docs/protocol.md`.
// Generated from src/autodrive/protocol by scripts/generate-messages: change the messages there.
#pragma once

#include <Eigen/Core>
#include <Eigen/Geometry>
#include <array>
#include <cstdint>
#include <map>
#include <nlohmann/json.hpp>
#include <optional>
#include <string>
#include <variant>
#include <vector>

/// Native protocol of the simulator.
namespace autodrive {

/// JSON of the library nlohmann::json.
using Json = nlohmann::json;

constexpr int PROTOCOL = 2;  ///< Version of the protocol.
constexpr const char* SUBPROTOCOL = "autodrive.v2";  ///< Subprotocol of the WebSocket.
/// Order of the wheels in all arrays.
constexpr std::array<const char*, 4> WHEEL_NAMES = {"front_left", "front_right", "rear_left", "rear_right"};

/// Front lamps: off, low beam (lamp 1 of each side), high beam (lamps 1 and 2). Report, section 3.1.4.
struct Headlights {
    enum : int { OFF = 0, LOW = 1, HIGH = 2 };
};

/// Turning indicators: off, left, right, hazard (both). Report, section 3.1.4.
struct Indicators {
    enum : int { OFF = 0, LEFT = 1, RIGHT = 2, HAZARD = 3 };
};

/// Command of a driver for one vehicle.
///
/// `throttle` [-1, 1]: fraction of the drive limit, forward positive; 0 brakes. `steering` [-1, 1]: fraction of
/// the steering limit, left positive. Both are clamped. `headlights`, `indicators`: None keeps their state.
struct Command {
    double throttle = 0.0;
    double steering = 0.0;
    std::optional<int> headlights;
    std::optional<int> indicators;
};

/// Weather, and the state of the ground; the default is a clear sky over dry ground.
///
/// `wetness` and `snow_cover` of the ground: None lets them follow rain and snow, a number holds them. A Frame has
/// their values. See `docs/weather.md` for the amounts in units of physics.
struct Weather {
    double clouds = 0.0;
    double fog = 0.0;
    double rain = 0.0;
    double snow = 0.0;
    double wind = 0.0;
    std::optional<double> wetness;
    std::optional<double> snow_cover;
};

/// Points, lines or a text in the view, not in the images of sensors. See `DrawCalls`.
///
/// `points` x, y, z [m] in the map frame. 'path': a line through all; 'lines': one between each pair; 'text': its
/// middle. `color`: red, green, blue and opacity, 0 to 1, sRGB. `size` [m]: diameter of points, width of lines, height
/// of a text. `lifetime`: simulated time after which it disappears [s]; None: it stays.
struct Drawing {
    std::string kind = "path";
    std::vector<Eigen::Vector3d> points;
    std::string text;
    std::array<double, 4> color = {1.0, 0.58, 0.0, 1.0};
    double size = 0.02;
    std::optional<double> lifetime;
};

/// One scan. Ray i has the angle angle_min + i * angle_increment [rad] in the axes of the sensor, left positive.
///
/// `ranges` [m], shape (n_ray,), as in REP 117: -inf is below range_min, +inf is no return within range_max.
/// `intensities`, shape (n_ray,). `time` is the time of the last ray; a rolling scan started `scan_time` earlier.
/// `time_increment` [s] between rays is 0 for an instantaneous scan. `scan_rate` [Hz].
struct LidarScan {
    double time = 0.0;
    std::vector<double> ranges;
    std::vector<double> intensities;
    double angle_min = 0.0;
    double angle_increment = 0.0;
    double range_min = 0.0;
    double range_max = 0.0;
    double scan_rate = 0.0;
    double scan_time = 0.0;
    double time_increment = 0.0;
};

/// A new LIDAR scan; sent before the first Frame that it belongs to.
struct Scan {
    static constexpr const char* type = "Scan";
    std::string vehicle;
    LidarScan scan;
};

/// Position [m], shape (3,), and orientation (quaternion wxyz), shape (4,), in the map frame.
struct Pose {
    Eigen::Vector3d position = Eigen::Vector3d::Zero();
    Eigen::Quaterniond orientation = Eigen::Quaterniond::Identity();
};

/// The pinhole model of a camera, in pixels.
///
/// A point (x, y, z) in the optical frame is at u = cx + fx x / z, v = cy + fy y / z, from the upper left corner of
/// the image; pixel (0, 0) covers 0 to 1 in both. `distortion` k1, k2, p1, p2, k3 is applied to x / z and y / z first
/// (Brown-Conrady, same as OpenCV and ROS 'plumb_bob').
struct CameraIntrinsics {
    std::int64_t width = 0;
    std::int64_t height = 0;
    double fx = 0.0;
    double fy = 0.0;
    double cx = 0.0;
    double cy = 0.0;
    std::array<double, 5> distortion = {0.0, 0.0, 0.0, 0.0, 0.0};
};

/// A new image of a sensor camera as JPEG; sent before the first Frame that it belongs to.
struct Picture {
    static constexpr const char* type = "Picture";
    std::string vehicle;
    std::string camera;
    double time = 0.0;
    Pose pose;  ///< Map from optical frame.
    CameraIntrinsics intrinsics;  ///< Intrinsics of the full image; the JPEG has the subscribed `picture_width`.
    std::vector<std::uint8_t> jpeg;
};

/// Rear wheels, left then right: `ticks` (int64, shape (2,)) and `angles` [rad], shape (2,); never wrap.
struct EncoderReading {
    double time = 0.0;
    std::array<std::int64_t, 2> ticks = {};
    Eigen::Vector2d angles = Eigen::Vector2d::Zero();
    std::int64_t left_ticks = 0;  ///< `ticks[0]`
    std::int64_t right_ticks = 0;  ///< `ticks[1]`
};

/// Position [m] of the rear axle centre in the map frame, shape (3,).
struct IpsReading {
    double time = 0.0;
    Eigen::Vector3d position = Eigen::Vector3d::Zero();
};

/// Inertial data in the axes of the sensor (REP 103, REP 145).
///
/// `orientation` wxyz, shape (4,); `euler` roll, pitch, yaw [rad] in (-pi, pi], shape (3,), with
/// R = Rz(yaw) Ry(pitch) Rx(roll); `angular_velocity` [rad/s], shape (3,); `linear_acceleration` [m/s^2], shape
/// (3,), without gravity unless the spec asks for specific force.
struct ImuReading {
    double time = 0.0;
    Eigen::Quaterniond orientation = Eigen::Quaterniond::Identity();
    Eigen::Vector3d euler = Eigen::Vector3d::Zero();
    Eigen::Vector3d angular_velocity = Eigen::Vector3d::Zero();
    Eigen::Vector3d linear_acceleration = Eigen::Vector3d::Zero();
};

/// Rear red lamps: off, partial (with headlights), bright (brakes applied). Report, section 3.1.4.
struct TailLights {
    enum : int { OFF = 0, PARTIAL = 1, BRIGHT = 2 };
};

/// State of the lamps. `left_indicator` and `right_indicator`: whether the blinking lamp is lit now.
struct Lights {
    int headlights = 0;
    int indicators = 0;
    int tail_lights = 0;
    bool left_indicator = false;
    bool right_indicator = false;
    bool reverse_lights = false;
};

/// Ground truth of the wheels, shape (4,) each, in the order of `WHEEL_NAMES`.
///
/// `steering_angle` [rad], `rotation_angle` [rad], `angular_velocity` [rad/s], `compression` [m] of the suspension
/// (0 at the target position), `normal_load` [N], `slip_ratio` and `slip_angle` [rad].
struct WheelsReading {
    Eigen::Vector4d steering_angle = Eigen::Vector4d::Zero();
    Eigen::Vector4d rotation_angle = Eigen::Vector4d::Zero();
    Eigen::Vector4d angular_velocity = Eigen::Vector4d::Zero();
    Eigen::Vector4d compression = Eigen::Vector4d::Zero();
    Eigen::Vector4d normal_load = Eigen::Vector4d::Zero();
    Eigen::Vector4d slip_ratio = Eigen::Vector4d::Zero();
    Eigen::Vector4d slip_angle = Eigen::Vector4d::Zero();
};

/// One image, taken at `time` [s].
///
/// `pose` is the pose of the optical frame (x right, y down, z forward, REP 103) in the map frame. `rgba`
/// uint8, shape (height, width, 4), C-contiguous, first row on top, sRGB; alpha is 255. If configured: `depth` [m]
/// float32, shape (height, width), along z of the optical frame, inf for no surface; `labels` uint8, same shape, see
/// `autodrive.graphics.assets.asset.Label`; `instances` uint16, same shape, the number of the object that the pixel
/// shows, see `World.instances`, 0 for none.
struct CameraImage {
    double time = 0.0;
    Pose pose;
    CameraIntrinsics intrinsics;
    std::vector<std::uint8_t> rgba;
    std::optional<std::vector<float>> depth;
    std::optional<std::vector<std::uint8_t>> labels;
    std::optional<std::vector<std::uint16_t>> instances;
};

/// Distance to the nearest object in the cone of a range sensor around the x axis of the sensor.
///
/// `range` [m] as in REP 117: -inf is below range_min, +inf is no return within range_max. `field_of_view` [rad] is the
/// full opening angle of the cone.
struct RangeReading {
    double time = 0.0;
    double range = 0.0;
    double field_of_view = 0.0;
    double range_min = 0.0;
    double range_max = 0.0;
    std::string radiation;
};

/// A vehicle in a race: it waits for the start, races, has finished, is disqualified, or has retired.
struct RaceStatus {
    enum : int { WAITING = 0, RACING = 1, FINISHED = 2, DISQUALIFIED = 3, RETIRED = 4 };
};

/// A vehicle in a race, ground truth. Times are in simulated seconds.
///
/// `lap_count` completed laps of `lap_total`, with warm-up laps (0: without limit); `lap_time` in the present lap;
/// `last_lap_time`, and `best_lap_time` of the laps that count, are infinite until there is one. `race_time` of the
/// laps that count, so far, without `penalty` [s]. `collision_count` of the collisions that the rules count.
/// `checkpoint`: number of the checkpoint passed last in this lap, 0 before the first one. `distance` [m] along the
/// track since the start line; `rank` from 1; `gap` to the first vehicle [s].
struct RaceState {
    int status = 0;
    std::int64_t lap_count = 0;
    std::int64_t lap_total = 0;
    double lap_time = 0.0;
    double last_lap_time = 0.0;
    double best_lap_time = 0.0;
    double race_time = 0.0;
    double penalty = 0.0;
    std::int64_t collision_count = 0;
    std::int64_t checkpoint = 0;
    double distance = 0.0;
    std::int64_t rank = 0;
    double gap = 0.0;
    bool is_wrong_way = false;
};

/// The reading of a sensor of the user: `values`, shape (n,), and the name of each in `columns`: 'distance [m]'.
///
/// A value may be infinite or NaN.
struct OwnReading {
    double time = 0.0;
    std::vector<double> values;
    std::vector<std::string> columns;
};

/// The latest radio message of another vehicle: what it was at `sent` [s]; the message arrived at `received` [s].
///
/// `position` [m], shape (3,), in the map frame, with the noise of the channel; `yaw` [rad]; `speed` [m/s], negative in
/// reverse; `steering` [rad], left positive.
struct HeardVehicle {
    double sent = 0.0;
    double received = 0.0;
    Eigen::Vector3d position = Eigen::Vector3d::Zero();
    double yaw = 0.0;
    double speed = 0.0;
    double steering = 0.0;
    Lights lights;
    int headlights = 0;  ///< `lights.headlights`
    int indicators = 0;  ///< `lights.indicators`
};

/// What a traffic light shows; the numbers are those of the devkit.
struct TrafficLightState {
    enum : int { OFF = 0, RED = 1, YELLOW = 2, GREEN = 3 };
};

/// The latest radio message of a traffic light: what it showed at `sent` [s]; it arrived at `received` [s].
///
/// `time_to_change` [s] counts from `sent`; None: it is not known or does not change.
struct HeardLight {
    double sent = 0.0;
    double received = 0.0;
    int state = 0;
    std::optional<double> time_to_change;
};

/// What a vehicle has heard by radio: the latest message of each vehicle and each traffic light, by name.
struct V2xReading {
    std::map<std::string, HeardVehicle> vehicles;
    std::map<std::string, HeardLight> lights;
};

/// One vehicle at the time of the Frame: ground truth, actuator feedback, and the latest reading of every sensor.
///
/// `pose` is the pose of the vehicle frame (origin: centre of the rear axle at wheel-centre height). `velocity` [m/s]
/// of its origin and `angular_velocity` [rad/s], shape (3,), are in vehicle axes. `throttle` [-1, 1] is the current
/// command of the drive actuators; `steering` [rad], left positive, is the angle of the steering actuator (report,
/// tables 2 and 3; sampled every tick). `lidar` is the latest scan, `range` the latest measurement of the range sensor;
/// None without such a sensor. `cameras` holds the latest image of each camera by its name ('front', 'rear'); it is
/// empty if cameras are off and before the first image, see `Images`. `race`: laps and times; None without a race.
/// `own` holds the latest reading of each sensor of the user by its name, see `World.add_sensor`. `v2x`: what it has
/// heard by radio; None without a channel in the scenario. `is_traffic`: it
/// is one of the cars of `ScenarioSpec.traffic`, which drive themselves.
struct VehicleFrame {
    Pose pose;
    Eigen::Vector3d velocity = Eigen::Vector3d::Zero();
    Eigen::Vector3d angular_velocity = Eigen::Vector3d::Zero();
    double throttle = 0.0;
    double steering = 0.0;
    EncoderReading encoders;
    IpsReading ips;
    ImuReading imu;
    std::optional<LidarScan> lidar;
    Lights lights;
    WheelsReading wheels;
    bool is_autonomous = false;
    std::int64_t collision_count = 0;
    std::map<std::string, CameraImage> cameras;
    std::optional<RangeReading> range;
    std::optional<RaceState> race;
    std::map<std::string, OwnReading> own;
    std::optional<V2xReading> v2x;
    bool is_traffic = false;
    Eigen::Vector3d position = Eigen::Vector3d::Zero();  ///< `ips.position`
    int headlights = 0;  ///< `lights.headlights`
    int indicators = 0;  ///< `lights.indicators`
    std::map<std::string, HeardVehicle> heard_vehicles;  ///< `v2x.vehicles`
    std::map<std::string, HeardLight> heard_lights;  ///< `v2x.lights`
    double speed() const { return velocity.x(); }  ///< Forward speed [m/s], negative in reverse.
};

/// A movable object, for example a construction box.
struct ObjectFrame {
    Pose pose;
    Eigen::Vector3d position = Eigen::Vector3d::Zero();  ///< `pose.position`
    Eigen::Quaterniond orientation = Eigen::Quaterniond::Identity();  ///< `pose.orientation`
    operator const Pose&() const { return pose; }  ///< The pose.
};

/// First contact of a vehicle with another object, which it has not touched for 0.2 s.
///
/// A wall of the map file, with all its parts, is one object. `other` is the name of the vehicle, box or part of the
/// map; `impulse` [N s] is the magnitude of the contact impulse of the tick, `CollisionEnded` has that of the whole
/// collision; `position` [m] is a contact point in the map frame, shape (3,).
struct Collision {
    static constexpr const char* type = "Collision";
    double time = 0.0;
    std::string vehicle;
    std::string other;
    double impulse = 0.0;
    Eigen::Vector3d position = Eigen::Vector3d::Zero();
};

/// A vehicle has not touched an object of a `Collision` for 0.2 s.
///
/// `other` is that of the `Collision`; `impulse` [N s] is the sum of the magnitudes of the contact impulses of all
/// ticks, `duration` [s] the time from the first to the last of these ticks.
struct CollisionEnded {
    static constexpr const char* type = "CollisionEnded";
    double time = 0.0;
    std::string vehicle;
    std::string other;
    double impulse = 0.0;
    double duration = 0.0;
};

/// The first wheel of a vehicle left the drivable area; `position` [m], shape (3,), is its rear axle centre.
struct OffRoad {
    static constexpr const char* type = "OffRoad";
    double time = 0.0;
    std::string vehicle;
    Eigen::Vector3d position = Eigen::Vector3d::Zero();
};

/// All wheels of a vehicle are on the drivable area again.
struct BackOnRoad {
    static constexpr const char* type = "BackOnRoad";
    double time = 0.0;
    std::string vehicle;
    Eigen::Vector3d position = Eigen::Vector3d::Zero();
};

/// The front of a vehicle crossed the stop line of a traffic light at red.
///
/// `position` [m], shape (3,), is the rear axle centre of the vehicle.
struct RedLight {
    static constexpr const char* type = "RedLight";
    double time = 0.0;
    std::string vehicle;
    std::string light;
    Eigen::Vector3d position = Eigen::Vector3d::Zero();
};

/// The front of a vehicle crossed the stop line of a stop sign, and the vehicle had not stopped before the line.
///
/// `position` [m], shape (3,), is the rear axle centre of the vehicle.
struct StopSign {
    static constexpr const char* type = "StopSign";
    double time = 0.0;
    std::string vehicle;
    std::string sign;
    Eigen::Vector3d position = Eigen::Vector3d::Zero();
};

/// A vehicle passed a checkpoint at `time`, within the tick; `lap` from 1, `split` [s] since the start of the lap.
///
/// `sector_time` [s] since the checkpoint that it passed before. The finish line is the last checkpoint.
struct CheckpointPassed {
    static constexpr const char* type = "CheckpointPassed";
    double time = 0.0;
    std::string vehicle;
    std::int64_t lap = 0;
    std::int64_t checkpoint = 0;
    double split = 0.0;
    double sector_time = 0.0;
    Eigen::Vector3d position = Eigen::Vector3d::Zero();
};

/// A vehicle completed a lap at `time`, within the tick; `lap` from 1. `is_counted`: not a warm-up lap.
struct LapCompleted {
    static constexpr const char* type = "LapCompleted";
    double time = 0.0;
    std::string vehicle;
    std::int64_t lap = 0;
    double lap_time = 0.0;
    bool is_counted = false;
    Eigen::Vector3d position = Eigen::Vector3d::Zero();
};

/// The rules add `duration` [s] to the time of a vehicle.
struct RacePenalty {
    static constexpr const char* type = "RacePenalty";
    double time = 0.0;
    std::string vehicle;
    std::string reason;
    double duration = 0.0;
    Eigen::Vector3d position = Eigen::Vector3d::Zero();
};

/// The rules set a vehicle back to a checkpoint, 0: the start line; `position` is that before.
struct SetBack {
    static constexpr const char* type = "SetBack";
    double time = 0.0;
    std::string vehicle;
    std::int64_t checkpoint = 0;
    Eigen::Vector3d position = Eigen::Vector3d::Zero();
};

/// A vehicle drives against the direction of the track.
struct WrongWay {
    static constexpr const char* type = "WrongWay";
    double time = 0.0;
    std::string vehicle;
    Eigen::Vector3d position = Eigen::Vector3d::Zero();
};

/// A vehicle started, finished, retired or was disqualified, for this reason.
struct RaceStatusChanged {
    static constexpr const char* type = "RaceStatusChanged";
    double time = 0.0;
    std::string vehicle;
    int status = 0;
    std::string reason;
    Eigen::Vector3d position = Eigen::Vector3d::Zero();
};

/// An event. If its type is not known because the simulator is newer, `value` is empty.
struct Event {
    /// One of the events; `std::monostate` if its type is not known.
    using Value = std::variant<
        std::monostate, Collision, CollisionEnded, OffRoad, BackOnRoad, RedLight, StopSign, CheckpointPassed, LapCompleted,
        RacePenalty, SetBack, WrongWay, RaceStatusChanged>;

    std::string type;  ///< "Collision", "OffRoad", "RedLight", "StopSign", "LapCompleted" ...
    double time = 0.0;  ///< simulated time [s]
    std::string vehicle;  ///< name of the vehicle
    std::string other;  ///< name of the other object in a collision, of the traffic light, or of the stop sign
    Eigen::Vector3d position = Eigen::Vector3d::Zero();  ///< in the map [m]
    Value value;  ///< all fields

    /// The event with all its fields; null if it is not of that type: `event.as<autodrive::LapCompleted>()`.
    template <typename Kind>
    const Kind* as() const {
        return std::get_if<Kind>(&value);
    }
};

/// What the weather of a Frame means for its first vehicle.
///
/// `grip`: factor of the friction of its tyres. `sight` [m] infinite in clear air. `lidar_dark`, `lidar_bright`: range
/// of its LIDAR at a reflectivity of 10 % and of 80 % [m]; None without a LIDAR.
struct WeatherEffects {
    double grip = 0.0;
    double sight = 0.0;
    std::optional<double> lidar_dark;
    std::optional<double> lidar_bright;
};

/// A traffic light: what it shows, and the time until that changes [s]; None: it is not known or does not change.
///
/// `mode`: 'program', 'flashing' (yellow, as its program says at night), 'set' (by a request), or 'off'.
struct TrafficLightFrame {
    int state = 0;
    std::optional<double> time_to_change;
    std::string mode;
};

/// The world after a tick: `time` [s] since reset, number of ticks, vehicles and movable objects by name.
///
/// `events` are the events of this tick, in order. `scene_light` is True by day. `time_of_day` is the time since
/// midnight [s], None if the light is fixed. `weather` and `weather_effects` are None under a clear sky over dry
/// ground. `traffic_lights` are those of the map, by name.
struct Frame {
    static constexpr const char* type = "Frame";
    double time = 0.0;
    std::int64_t tick = 0;
    std::map<std::string, VehicleFrame> vehicles;
    std::map<std::string, ObjectFrame> objects;
    std::vector<Event> events;
    bool scene_light = false;
    std::optional<double> time_of_day;
    std::optional<Weather> weather;
    std::optional<WeatherEffects> weather_effects;
    std::map<std::string, TrafficLightFrame> traffic_lights;
};

/// Another name of `TrafficLightFrame`.
using TrafficLight = TrafficLightFrame;

}  // namespace autodrive

/// \cond
namespace autodrive::wire {

// MessagePack extension of an array of these values; 0: there is none
template <typename Value>
inline constexpr int array_code = 0;
template <>
inline constexpr int array_code<double> = 1;
template <>
inline constexpr int array_code<std::int64_t> = 2;
template <>
inline constexpr int array_code<float> = 3;
template <>
inline constexpr int array_code<std::uint8_t> = 4;
template <>
inline constexpr int array_code<std::uint16_t> = 5;

// Calls visit(name, value, is_required) for each field of a message.
template <typename Visit>
void visit_fields(Command& m, Visit visit) {
    visit("throttle", m.throttle, false);
    visit("steering", m.steering, false);
    visit("headlights", m.headlights, false);
    visit("indicators", m.indicators, false);
}

template <typename Visit>
void visit_fields(Weather& m, Visit visit) {
    visit("clouds", m.clouds, false);
    visit("fog", m.fog, false);
    visit("rain", m.rain, false);
    visit("snow", m.snow, false);
    visit("wind", m.wind, false);
    visit("wetness", m.wetness, false);
    visit("snow_cover", m.snow_cover, false);
}

template <typename Visit>
void visit_fields(Drawing& m, Visit visit) {
    visit("kind", m.kind, true);
    visit("points", m.points, true);
    visit("text", m.text, false);
    visit("color", m.color, false);
    visit("size", m.size, false);
    visit("lifetime", m.lifetime, false);
}

template <typename Visit>
void visit_fields(LidarScan& m, Visit visit) {
    visit("time", m.time, true);
    visit("ranges", m.ranges, true);
    visit("intensities", m.intensities, true);
    visit("angle_min", m.angle_min, true);
    visit("angle_increment", m.angle_increment, true);
    visit("range_min", m.range_min, true);
    visit("range_max", m.range_max, true);
    visit("scan_rate", m.scan_rate, true);
    visit("scan_time", m.scan_time, true);
    visit("time_increment", m.time_increment, true);
}

template <typename Visit>
void visit_fields(Scan& m, Visit visit) {
    visit("vehicle", m.vehicle, true);
    visit("scan", m.scan, true);
}

template <typename Visit>
void visit_fields(Pose& m, Visit visit) {
    visit("position", m.position, true);
    visit("orientation", m.orientation, true);
}

template <typename Visit>
void visit_fields(CameraIntrinsics& m, Visit visit) {
    visit("width", m.width, true);
    visit("height", m.height, true);
    visit("fx", m.fx, true);
    visit("fy", m.fy, true);
    visit("cx", m.cx, true);
    visit("cy", m.cy, true);
    visit("distortion", m.distortion, false);
}

template <typename Visit>
void visit_fields(Picture& m, Visit visit) {
    visit("vehicle", m.vehicle, true);
    visit("camera", m.camera, true);
    visit("time", m.time, true);
    visit("pose", m.pose, true);
    visit("intrinsics", m.intrinsics, true);
    visit("jpeg", m.jpeg, true);
}

template <typename Visit>
void visit_fields(EncoderReading& m, Visit visit) {
    visit("time", m.time, true);
    visit("ticks", m.ticks, true);
    visit("angles", m.angles, true);
}

template <typename Visit>
void visit_fields(IpsReading& m, Visit visit) {
    visit("time", m.time, true);
    visit("position", m.position, true);
}

template <typename Visit>
void visit_fields(ImuReading& m, Visit visit) {
    visit("time", m.time, true);
    visit("orientation", m.orientation, true);
    visit("euler", m.euler, true);
    visit("angular_velocity", m.angular_velocity, true);
    visit("linear_acceleration", m.linear_acceleration, true);
}

template <typename Visit>
void visit_fields(Lights& m, Visit visit) {
    visit("headlights", m.headlights, true);
    visit("indicators", m.indicators, true);
    visit("tail_lights", m.tail_lights, true);
    visit("left_indicator", m.left_indicator, true);
    visit("right_indicator", m.right_indicator, true);
    visit("reverse_lights", m.reverse_lights, true);
}

template <typename Visit>
void visit_fields(WheelsReading& m, Visit visit) {
    visit("steering_angle", m.steering_angle, true);
    visit("rotation_angle", m.rotation_angle, true);
    visit("angular_velocity", m.angular_velocity, true);
    visit("compression", m.compression, true);
    visit("normal_load", m.normal_load, true);
    visit("slip_ratio", m.slip_ratio, true);
    visit("slip_angle", m.slip_angle, true);
}

template <typename Visit>
void visit_fields(CameraImage& m, Visit visit) {
    visit("time", m.time, true);
    visit("pose", m.pose, true);
    visit("intrinsics", m.intrinsics, true);
    visit("rgba", m.rgba, true);
    visit("depth", m.depth, false);
    visit("labels", m.labels, false);
    visit("instances", m.instances, false);
}

template <typename Visit>
void visit_fields(RangeReading& m, Visit visit) {
    visit("time", m.time, true);
    visit("range", m.range, true);
    visit("field_of_view", m.field_of_view, true);
    visit("range_min", m.range_min, true);
    visit("range_max", m.range_max, true);
    visit("radiation", m.radiation, true);
}

template <typename Visit>
void visit_fields(RaceState& m, Visit visit) {
    visit("status", m.status, true);
    visit("lap_count", m.lap_count, true);
    visit("lap_total", m.lap_total, true);
    visit("lap_time", m.lap_time, true);
    visit("last_lap_time", m.last_lap_time, true);
    visit("best_lap_time", m.best_lap_time, true);
    visit("race_time", m.race_time, true);
    visit("penalty", m.penalty, true);
    visit("collision_count", m.collision_count, true);
    visit("checkpoint", m.checkpoint, true);
    visit("distance", m.distance, true);
    visit("rank", m.rank, true);
    visit("gap", m.gap, true);
    visit("is_wrong_way", m.is_wrong_way, true);
}

template <typename Visit>
void visit_fields(OwnReading& m, Visit visit) {
    visit("time", m.time, true);
    visit("values", m.values, true);
    visit("columns", m.columns, true);
}

template <typename Visit>
void visit_fields(HeardVehicle& m, Visit visit) {
    visit("sent", m.sent, true);
    visit("received", m.received, true);
    visit("position", m.position, true);
    visit("yaw", m.yaw, true);
    visit("speed", m.speed, true);
    visit("steering", m.steering, true);
    visit("lights", m.lights, true);
}

template <typename Visit>
void visit_fields(HeardLight& m, Visit visit) {
    visit("sent", m.sent, true);
    visit("received", m.received, true);
    visit("state", m.state, true);
    visit("time_to_change", m.time_to_change, true);
}

template <typename Visit>
void visit_fields(V2xReading& m, Visit visit) {
    visit("vehicles", m.vehicles, true);
    visit("lights", m.lights, true);
}

template <typename Visit>
void visit_fields(VehicleFrame& m, Visit visit) {
    visit("pose", m.pose, true);
    visit("velocity", m.velocity, true);
    visit("angular_velocity", m.angular_velocity, true);
    visit("throttle", m.throttle, true);
    visit("steering", m.steering, true);
    visit("encoders", m.encoders, true);
    visit("ips", m.ips, true);
    visit("imu", m.imu, true);
    visit("lidar", m.lidar, true);
    visit("lights", m.lights, true);
    visit("wheels", m.wheels, true);
    visit("is_autonomous", m.is_autonomous, true);
    visit("collision_count", m.collision_count, true);
    visit("cameras", m.cameras, false);
    visit("range", m.range, false);
    visit("race", m.race, false);
    visit("own", m.own, false);
    visit("v2x", m.v2x, false);
    visit("is_traffic", m.is_traffic, false);
}

template <typename Visit>
void visit_fields(ObjectFrame& m, Visit visit) {
    visit("pose", m.pose, true);
}

template <typename Visit>
void visit_fields(Collision& m, Visit visit) {
    visit("time", m.time, true);
    visit("vehicle", m.vehicle, true);
    visit("other", m.other, true);
    visit("impulse", m.impulse, true);
    visit("position", m.position, true);
}

template <typename Visit>
void visit_fields(CollisionEnded& m, Visit visit) {
    visit("time", m.time, true);
    visit("vehicle", m.vehicle, true);
    visit("other", m.other, true);
    visit("impulse", m.impulse, true);
    visit("duration", m.duration, true);
}

template <typename Visit>
void visit_fields(OffRoad& m, Visit visit) {
    visit("time", m.time, true);
    visit("vehicle", m.vehicle, true);
    visit("position", m.position, true);
}

template <typename Visit>
void visit_fields(BackOnRoad& m, Visit visit) {
    visit("time", m.time, true);
    visit("vehicle", m.vehicle, true);
    visit("position", m.position, true);
}

template <typename Visit>
void visit_fields(RedLight& m, Visit visit) {
    visit("time", m.time, true);
    visit("vehicle", m.vehicle, true);
    visit("light", m.light, true);
    visit("position", m.position, true);
}

template <typename Visit>
void visit_fields(StopSign& m, Visit visit) {
    visit("time", m.time, true);
    visit("vehicle", m.vehicle, true);
    visit("sign", m.sign, true);
    visit("position", m.position, true);
}

template <typename Visit>
void visit_fields(CheckpointPassed& m, Visit visit) {
    visit("time", m.time, true);
    visit("vehicle", m.vehicle, true);
    visit("lap", m.lap, true);
    visit("checkpoint", m.checkpoint, true);
    visit("split", m.split, true);
    visit("sector_time", m.sector_time, true);
    visit("position", m.position, true);
}

template <typename Visit>
void visit_fields(LapCompleted& m, Visit visit) {
    visit("time", m.time, true);
    visit("vehicle", m.vehicle, true);
    visit("lap", m.lap, true);
    visit("lap_time", m.lap_time, true);
    visit("is_counted", m.is_counted, true);
    visit("position", m.position, true);
}

template <typename Visit>
void visit_fields(RacePenalty& m, Visit visit) {
    visit("time", m.time, true);
    visit("vehicle", m.vehicle, true);
    visit("reason", m.reason, true);
    visit("duration", m.duration, true);
    visit("position", m.position, true);
}

template <typename Visit>
void visit_fields(SetBack& m, Visit visit) {
    visit("time", m.time, true);
    visit("vehicle", m.vehicle, true);
    visit("checkpoint", m.checkpoint, true);
    visit("position", m.position, true);
}

template <typename Visit>
void visit_fields(WrongWay& m, Visit visit) {
    visit("time", m.time, true);
    visit("vehicle", m.vehicle, true);
    visit("position", m.position, true);
}

template <typename Visit>
void visit_fields(RaceStatusChanged& m, Visit visit) {
    visit("time", m.time, true);
    visit("vehicle", m.vehicle, true);
    visit("status", m.status, true);
    visit("reason", m.reason, true);
    visit("position", m.position, true);
}

template <typename Visit>
void visit_fields(WeatherEffects& m, Visit visit) {
    visit("grip", m.grip, true);
    visit("sight", m.sight, true);
    visit("lidar_dark", m.lidar_dark, true);
    visit("lidar_bright", m.lidar_bright, true);
}

template <typename Visit>
void visit_fields(TrafficLightFrame& m, Visit visit) {
    visit("state", m.state, true);
    visit("time_to_change", m.time_to_change, true);
    visit("mode", m.mode, true);
}

template <typename Visit>
void visit_fields(Frame& m, Visit visit) {
    visit("time", m.time, true);
    visit("tick", m.tick, true);
    visit("vehicles", m.vehicles, true);
    visit("objects", m.objects, true);
    visit("events", m.events, true);
    visit("scene_light", m.scene_light, true);
    visit("time_of_day", m.time_of_day, false);
    visit("weather", m.weather, false);
    visit("weather_effects", m.weather_effects, false);
    visit("traffic_lights", m.traffic_lights, false);
}

// Sets the fields of a message that repeat others.
template <typename Message>
void repeat(Message&) {}
inline void repeat(EncoderReading& m) {
    m.left_ticks = m.ticks[0];
    m.right_ticks = m.ticks[1];
}
inline void repeat(HeardVehicle& m) {
    m.headlights = m.lights.headlights;
    m.indicators = m.lights.indicators;
}
inline void repeat(VehicleFrame& m) {
    m.position = m.ips.position;
    m.headlights = m.lights.headlights;
    m.indicators = m.lights.indicators;
    m.heard_vehicles = m.v2x.value_or(V2xReading{}).vehicles;
    m.heard_lights = m.v2x.value_or(V2xReading{}).lights;
}
inline void repeat(ObjectFrame& m) {
    m.position = m.pose.position;
    m.orientation = m.pose.orientation;
}

}  // namespace autodrive::wire
/// \endcond
