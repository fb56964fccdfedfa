function force = mrdamper_force(damper, velocity, command, temperature, branch)
% MRDAMPER_FORCE  Force [N] of a damper's map at velocity [m/s], command [A or V], temperature [degC].
%   force = mrdamper_force(damper, velocity, command) takes the first temperature of the map;
%   mrdamper_force(damper, velocity, command, temperature, branch) another, and of a loop its branch:
%   'mean' (a peak-velocity pick, the default), 'rising' or 'falling' velocity.
%   Linear between the map's points, held at its ends. Arrays of one size, or single numbers.
map = damper.map;
if nargin < 4 || isempty(temperature)
  temperature = map.temperature_degC(1);
end
if nargin < 5
  branch = 'mean';
end
names = struct('mean', 'force_N', 'rising', 'force_rising_N', 'falling', 'force_falling_N');
table = map.(names.(branch));
ends = @(x, along) min(max(x, along(1)), along(end));
like = zeros(size(velocity + command + temperature));
asked = {ends(temperature, map.temperature_degC) + like, ends(command, map.command) + like, ...
         ends(velocity, map.velocity_m_s) + like};
along = {map.temperature_degC(:), map.command(:), map.velocity_m_s(:)};
kept = find(cellfun(@numel, along) > 1);
sizes = cellfun(@numel, along(kept));
if numel(kept) == 1
  force = reshape(interp1(along{kept}, table(:), asked{kept}(:)), size(like));
else
  force = interpn(along{kept}, reshape(table, sizes), asked{kept}, 'linear');
end
end
