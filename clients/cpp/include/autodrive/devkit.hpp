/// \file
/// A driving script for the AutoDRIVE devkits' protocol: the script is the server, the simulator (this one or the
/// original one) connects to it. Typed state in, typed command out, one callback.
#pragma once

#include <exception>
#include <functional>
#include <map>
#include <mutex>
#include <set>
#include <string>

#include "autodrive/telemetry.hpp"

namespace autodrive::devkit {

/// The server that a driving script is.
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
/// One thread, the one that calls `run`: it sleeps while nothing comes. What a callback throws ends `run`, which throws
/// it on.
class Server {
public:
    /// State of a vehicle in, its command out.
    using Drive = std::function<Command(const State&)>;
    /// A whole message in, a whole message out, every value a text; an empty object says nothing.
    using Respond = std::function<Json(const Json& telemetry)>;
    /// Hears of a value that cannot be read: "V1 Throttle: 'fast' is not a number".
    using Complain = std::function<void(const std::string& fault)>;

    /// Drives a vehicle, by its name "V1", "V2", ...; "" is the only one of the simulator of 2020.
    void on_state(Drive drive, const std::string& vehicle = "V1") {
        drivers_[vehicle] = Driver{vehicle.empty() ? "" : vehicle + " ", std::move(drive), State{}};
    }

    /// Answers the plain messages, for traffic lights and all that has no type here; called after the drivers.
    void on_message(Respond respond) { respond_ = std::move(respond); }

    /// Hears of what cannot be read; its last value stands. Left out, each fault is told once, on the standard error.
    void on_fault(Complain complain) { complain_ = std::move(complain); }

    /// Serves until `stop`, SIGINT or SIGTERM. Throws `boost::system::system_error` where it cannot listen, and what a
    /// callback throws. `host` "0.0.0.0" serves other machines too; `port` 0 takes a free one; `listening` is told it.
    void run(unsigned short port = 4567, const std::string& host = "127.0.0.1",
             const std::function<void(unsigned short)>& listening = {});

    /// Ends `run`; from any thread or callback.
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
    void complain(const std::string& fault);

    std::map<std::string, Driver> drivers_;
    Respond respond_;
    Complain complain_;
    std::set<std::string> told_;  // faults, by what they are about
    std::exception_ptr fault_;
    std::mutex mutex_;
    std::function<void()> end_;  // while it runs
};

}  // namespace autodrive::devkit

#ifndef AUTODRIVE_COMPILED
#include "autodrive/impl/devkit.ipp"
#endif
