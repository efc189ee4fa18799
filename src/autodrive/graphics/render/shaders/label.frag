// Semantic label of each pixel.
in vec3 place, facing, in_sun;
flat in vec3 own_color, own_emission;
flat in vec4 own_finish;
in vec3 own_uv;
out vec4 pixel;
void main() { pixel = vec4(own_finish.w / 255.0, 0.0, 0.0, 1.0); }
