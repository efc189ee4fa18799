// Blended as a screen.
layout(std140) uniform Frame { FRAME_FIELDS };
in vec3 scattered;
out vec4 pixel;
TONE
void main() { pixel = vec4(shown(scattered * exposure.x), 0.0); }
