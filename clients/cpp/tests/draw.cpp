// Draws a path, points and a text, removes the points, and prints the answer to a wrong drawing.
#include <autodrive/client.hpp>
#include <cstdlib>
#include <iostream>

int main(int, char** argv) {
    autodrive::Client simulator("127.0.0.1", static_cast<unsigned short>(std::atoi(argv[1])));
    autodrive::Drawing path;
    path.points = {{0.0, 0.0, 0.01}, {1.0, 0.5, 0.01}, {2.0, 0.0, 0.25}};
    simulator.draw("plan", path);
    autodrive::Drawing points;
    points.kind = "points";
    points.points = {{1.0, 2.0, 3.0}};
    simulator.draw("clusters", points);
    autodrive::Drawing text;
    text.kind = "text";
    text.points = {{1.0, 2.0, 0.5}};
    text.text = "goal";
    text.color = {0.0, 1.0, 0.0, 0.5};
    text.size = 0.06;
    text.lifetime = 2.0;
    simulator.draw("goal", text);
    simulator.clear_drawings("clusters");
    try {
        path.points.resize(1);
        simulator.draw("wrong", path);
    } catch (const autodrive::Refused& refused) {
        std::cout << refused.what() << std::endl;
    }
}
