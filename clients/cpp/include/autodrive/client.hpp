/// \file
/// Client of the native protocol: reads Frames, sends commands, and steps a paused simulation.
#pragma once

#include <chrono>
#include <map>
#include <memory>
#include <stdexcept>
#include <string>
#include <utility>

#include "autodrive/config.hpp"
#include "autodrive/messages.hpp"

namespace autodrive {

namespace detail {
class Connection;
struct Target;
}

/// The simulator refused a request; `what` is its message.
struct Refused : std::runtime_error {
    /// With the message of the simulator.
    explicit Refused(const std::string& message) : std::runtime_error(message) {}
};

/// What the simulator sends to a client.
struct Subscription {
    std::optional<double> frame_rate;  ///< maximum rate of Frames in wall time [Hz]; none: each tick; 0: no Frames
    bool scans = true;                 ///< whether LIDAR scans are sent
    double picture_rate = 0.0;         ///< maximum rate of images of each camera in wall time [Hz]; 0: none
};

/// A connection to a simulator, for use by one thread. Every call throws `Refused` if the simulator refuses, and
/// `boost::system::system_error` if the connection fails or there is no answer within `timeout`. A message with a value of
/// a wrong type throws a `std::runtime_error` that names the field; events and fields of a newer simulator do not.
///
///     autodrive::Client simulator("127.0.0.1", 8730);
///     simulator.pause();
///     for (int i = 0; i < 100; ++i) {
///         const autodrive::Frame frame = simulator.step(1, {{"V1", {0.5, 0.1}}});
///     }
class Client {
public:
    /// Connects, and waits for the Welcome and the Scene. `token` is the access token, if the simulator needs one.
    explicit Client(const std::string& host, unsigned short port = 8730, const std::string& token = "",
                    const Subscription& subscription = {},
                    std::chrono::milliseconds timeout = std::chrono::seconds(10));
    /// Connects to the port AUTODRIVE_PORT of this machine if that environment variable is set, else to the last run of
    /// this user in the current folder, else to port 8730, and prints to stderr what that is. Throws `Refused` if it is
    /// not this run, if AUTODRIVE_PORT and the run disagree, or if neither is there and it belongs to another user.
    Client();
    ~Client();  ///< Closes the connection.
    /// Moves the connection.
    Client(Client&&) noexcept;
    /// Moves the connection.
    Client& operator=(Client&&) noexcept;

    /// Waits for the next Frame. Frames that were not read in time are dropped; the latest one is kept, with the events of
    /// those that were dropped.
    Frame next();

    /// Drives a vehicle in autonomous mode. A command is valid for 0.5 s of simulated time, so it must be repeated.
    void drive(const std::string& vehicle, const Command& command);

    /// Runs a paused simulation for some ticks with these commands, and returns the Frame after them.
    Frame step(int ticks = 1, const std::map<std::string, Command>& commands = {});

    Frame pause();   ///< Pauses the simulation.
    Frame resume();  ///< Resumes the simulation.
    Frame reset();   ///< Restores the initial state.

    /// Moves a vehicle to x, y [m] and a heading [rad], at rest.
    Frame teleport(const std::string& vehicle, double x, double y, double yaw = 0.0);

    /// Lets sun and sky follow a time of day [s since midnight]; `scale`: seconds of the day per simulated second.
    Frame set_time_of_day(double time, double scale = 0.0);

    /// Sets the weather; the wetness and the snow cover of the ground follow unless they are set.
    Frame set_weather(const Weather& weather = {});

    /// Lets a traffic light show a state (0 off, 1 red, 2 yellow, 3 green) until a reset; none: what its program says.
    Frame set_traffic_light(const std::string& light, std::optional<int> state);

    /// Shows a drawing in the view instead of the one of that name.
    Frame draw(const std::string& name, const Drawing& drawing);

    /// Removes the drawing of that name; without a name, all.
    Frame clear_drawings(const std::optional<std::string>& name = {});

    /// Sends any operation of the protocol, and returns the Frame after it.
    Frame request(const Json& request);

    /// The latest image of a camera ("front", "rear"); null before the first one, or without a subscription.
    const Picture* picture(const std::string& vehicle, const std::string& camera) const {
        const auto found = pictures_.find({vehicle, camera});
        return found == pictures_.end() ? nullptr : &found->second;
    }

    const Json& welcome() const { return welcome_; }  ///< The Welcome message.
    const Json& scene() const { return scene_; }      ///< The Scene message: vehicles, map and objects.
    const Json& status() const { return status_; }    ///< The latest Status: pause, speed, drivers, bridge; null before the first one.

private:
    explicit Client(const detail::Target& target);
    void send(const Json& message);
    Json receive();
    void handle(const Json& message);
    void set_frame(const Json& json);

    std::unique_ptr<detail::Connection> connection_;
    std::int64_t next_id_ = 1;
    Json welcome_, scene_, status_;
    Frame frame_;
    bool is_new_ = false;
    std::map<std::string, LidarScan> scans_;
    std::map<std::pair<std::string, std::string>, Picture> pictures_;
};

}  // namespace autodrive

#ifndef AUTODRIVE_COMPILED
#include "autodrive/impl/client.ipp"
#endif
