/// \file
/// Server of the devkit protocol for driving scripts: a simulator, this one or the original one, connects to the script.
/// A callback receives the typed state of a vehicle and returns its typed command.
#pragma once

#include <exception>
#include <functional>
#include <map>
#include <mutex>
#include <set>
#include <string>

#include "autodrive/telemetry.hpp"

namespace autodrive::devkit {

/// The server of a driving script.
///
///     autodrive::devkit::Server server;
///     server.on_state([](const autodrive::devkit::State& state) {
///         autodrive::devkit::Command command;
///         command.throttle = 0.5;
///         command.steering = state.lidar_ranges.empty() ? 0.0 : 0.1;
///         return command;
///     });
///     server.run(4567);
///
/// It uses only the thread that calls `run`, which sleeps between messages. An exception of a callback ends `run` and is
/// rethrown by it.
class Server {
public:
    /// Computes the command of a vehicle from its state.
    using Drive = std::function<Command(const State&)>;
    /// Computes an answer from a complete message; all values are texts. An empty object is not sent.
    using Respond = std::function<Json(const Json& telemetry)>;
    /// Receives the error of a malformed value, for example "V1 Throttle: 'fast' is not a number".
    using OnError = std::function<void(const std::string& error)>;

    /// Sets the callback of a vehicle, by its name "V1", "V2", ...; "" is the vehicle of the 2020 simulator.
    void on_state(Drive drive, const std::string& vehicle = "V1") {
        drivers_[vehicle] = Driver{vehicle.empty() ? "" : vehicle + " ", std::move(drive), State{}};
    }

    /// Sets the callback for complete messages, for example for traffic lights; called after those of the vehicles.
    void on_message(Respond respond) { respond_ = std::move(respond); }

    /// Sets the callback for malformed values, which keep their last value. By default, each error is printed once to
    /// standard error.
    void on_error(OnError callback) { on_error_ = std::move(callback); }

    /// Serves until `stop`, SIGINT or SIGTERM. Throws `boost::system::system_error` if it cannot listen, and exceptions of
    /// callbacks. The host "0.0.0.0" accepts other machines too; port 0 selects a free port, passed to `listening`.
    void run(unsigned short port = 4567, const std::string& host = "127.0.0.1",
             const std::function<void(unsigned short)>& listening = {});

    /// Ends `run`; can be called from any thread or callback.
    void stop() {
        const std::lock_guard lock(mutex_);
        if (end_) end_();
    }

private:
    struct Driver {
        std::string prefix;
        Drive drive;
        State state;
    };

    std::string answer(std::string_view event);
    void report(const std::string& error);

    std::map<std::string, Driver> drivers_;
    Respond respond_;
    OnError on_error_;
    std::set<std::string> reported_;  // keys with errors
    std::exception_ptr exception_;
    std::mutex mutex_;
    std::function<void()> end_;  // set while `run` is running
};

}  // namespace autodrive::devkit

#ifndef AUTODRIVE_COMPILED
#include "autodrive/impl/devkit.ipp"
#endif
