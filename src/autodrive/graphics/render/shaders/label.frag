// Semantic label of each pixel, and its depth along the optical axis [m], which the depth buffer knows less exactly.
in vec3 place, facing, in_sun;
flat in vec3 own_color, own_emission;
flat in vec4 own_finish;
in vec3 own_uv;
layout(location = 0) out vec4 pixel;
layout(location = 1) out float depth;
void main() {
    pixel = vec4(own_finish.w / 255.0, 0.0, 0.0, 1.0);
    depth = 1.0 / gl_FragCoord.w;
}
