// A streak fades towards its ends, a flake towards its edge; a drop on the lens shows the sky, upside down. Blended as a
// screen, they add light and never darken.
in vec2 at;
flat in float alpha, is_drop;
flat in vec3 colour;
out vec4 pixel;
void main() {
    float far = dot(at, at);
    float drop = 0.9 * clamp(4.0 - 4.0 * far, 0.0, 1.0) * (0.15 + 0.85 * smoothstep(-0.9, 0.9, DOWN * at.y)) * (0.4 + 0.6 * far);
    pixel = vec4(colour * alpha * (is_drop > 0.5 ? drop : clamp(1.2 * (1.0 - far * 0.8), 0.0, 1.0)), 0.0);
}
