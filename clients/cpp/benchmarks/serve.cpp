// A driving script that reads all and wants the same always: what the server itself costs.
#include <autodrive/devkit.hpp>
#include <iostream>

int main() {
    autodrive::devkit::Server server;
    server.on_state([](const autodrive::devkit::State&) {
        autodrive::devkit::Command command;
        command.throttle = 0.5;
        command.steering = 0.1;
        return command;
    });
    server.run(0, "127.0.0.1", [](unsigned short port) { std::cout << port << std::endl; });
}
