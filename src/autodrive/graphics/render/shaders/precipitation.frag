// A streak fades towards its ends, a flake towards its edge. Blended as a screen, they add light and never darken.
in vec2 at;
flat in float alpha;
flat in vec3 colour;
out vec4 pixel;
void main() {
    pixel = vec4(colour * alpha * clamp(1.2 * (1.0 - dot(at, at) * 0.8), 0.0, 1.0), 0.0);
}
