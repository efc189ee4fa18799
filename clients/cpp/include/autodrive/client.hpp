/// \file
/// A client of the simulator's native protocol: reads Frames, drives, and moves time step by step.
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
}

/// The simulator refused; `what` is its words.
struct Refused : std::runtime_error {
    /// With the simulator's words.
    explicit Refused(const std::string& words) : std::runtime_error(words) {}
};

/// What a client is sent.
struct Subscription {
    std::optional<double> frame_rate;  ///< Frames a second of wall time at most [Hz]; none: each tick; 0: no Frames
    bool scans = true;                 ///< whether the LIDARs' scans come
    double picture_rate = 0.0;         ///< pictures of each camera a second of wall time at most [Hz]; 0: none
};

/// One connection; for one thread. Every call throws `Refused` with the simulator's words where it will not, and
/// `boost::system::system_error` where the connection fails or nothing comes for `timeout`.
///
///     autodrive::Client simulator("127.0.0.1", 8730);
///     simulator.pause();
///     for (int i = 0; i < 100; ++i) {
///         const autodrive::Frame frame = simulator.step(1, {{"V1", {0.5, 0.1}}});
///     }
class Client {
public:
    /// Connects, and waits until the simulator has told what there is. `token` is needed where the simulator asks for one;
    /// no answer within `timeout` is an error.
    explicit Client(const std::string& host = "127.0.0.1", unsigned short port = 8730, const std::string& token = "",
                    const Subscription& subscription = {},
                    std::chrono::milliseconds timeout = std::chrono::seconds(10));
    ~Client();  ///< Ends the connection.
    /// Takes the connection over.
    Client(Client&&) noexcept;
    /// Takes the connection over.
    Client& operator=(Client&&) noexcept;

    /// The next Frame of the stream. While it was not asked for, the simulator kept the latest, not a backlog.
    Frame next();

    /// Drives a vehicle in autonomous mode. A command is good for half a second of simulated time: send it again.
    void drive(const std::string& vehicle, const Command& command);

    /// While paused: so many ticks of simulated time, the first with these commands; the Frame after them.
    Frame step(int ticks = 1, const std::map<std::string, Command>& commands = {});

    Frame pause();   ///< Stops simulated time.
    Frame resume();  ///< Lets it run.
    Frame reset();   ///< Brings the initial state back.

    /// Puts a vehicle, at rest, at x, y [m] with a heading [rad].
    Frame teleport(const std::string& vehicle, double x, double y, double yaw = 0.0);

    /// Any request of the protocol; the Frame after it.
    Frame request(const Json& request);

    /// The latest picture of a camera ("front", "rear"); none before the first, or where none are subscribed to.
    const Picture* picture(const std::string& vehicle, const std::string& camera) const {
        const auto found = pictures_.find({vehicle, camera});
        return found == pictures_.end() ? nullptr : &found->second;
    }

    const Json& welcome() const { return welcome_; }  ///< The simulator's greeting.
    const Json& scene() const { return scene_; }      ///< What there is to draw.
    const Json& status() const { return status_; }    ///< Pause, speed, drivers, bridge; null before the first.

private:
    void send(const Json& message);
    Json receive();
    void take(const Json& message);
    void show(const Json& told);

    std::unique_ptr<detail::Connection> connection_;
    std::int64_t next_id_ = 1;
    Json welcome_, scene_, status_;
    Frame frame_;
    bool fresh_ = false;
    std::map<std::string, LidarScan> scans_;
    std::map<std::pair<std::string, std::string>, Picture> pictures_;
};

}  // namespace autodrive

#ifndef AUTODRIVE_COMPILED
#include "autodrive/impl/client.ipp"
#endif
