// How much sun static meshes and objects take from the ground, for scene.frag.
layout(std140) uniform Frame { FRAME_FIELDS };
uniform sampler2DShadow still_map;
in vec3 at;
out vec4 pixel;
SHADOW_FORMULAS
void main() {
    pixel = vec4(0.0, 0.0, 1.0 - unshaded(still_map, at), 0.0);
}
