% Curves of Hopf points over c and tau of the delayed network, all eight cells.
% targets.txt: number of the curve, j and k of the class, c, tau, omega, whether tau is held (else c)
1;
function f=net(x,p)
  s=[2 1 4 3 6 5 8 7]; r=[7 8 1 2 3 4 5 6]; x0=x(:,1,:); x1=x(s,2,:); t0=tanh(x0);
  f=reshape(p(1)*x0+p(2)*t0+p(4)*t0(r,:,:)+p(3)*tanh(x1),8,[]);
end
function f=net1(x,p,dx,dp)
  s=[2 1 4 3 6 5 8 7]; r=[7 8 1 2 3 4 5 6]; x0=x(:,1,:); x1=x(s,2,:); y0=dx(:,1,:); y1=dx(s,2,:);
  t0=tanh(x0); t1=tanh(x1); s0=(1-t0.^2).*y0;
  f=reshape(p(1)*y0+p(2)*s0+p(4)*s0(r,:,:)+p(3)*(1-t1.^2).*y1 ...
    +dp(1)*x0+dp(2)*t0+dp(4)*t0(r,:,:)+dp(3)*t1,8,[]);
end
function f=net2(x,p,dx,dp)
  s=[2 1 4 3 6 5 8 7]; r=[7 8 1 2 3 4 5 6]; x0=x(:,1,:); x1=x(s,2,:); y0=dx(:,1,:); y1=dx(s,2,:);
  t0=tanh(x0); t1=tanh(x1); g=@(t)-2*t.*(1-t.^2); q0=g(t0).*y0.^2; s0=(1-t0.^2).*y0;
  f=reshape(p(2)*q0+p(4)*q0(r,:,:)+p(3)*g(t1).*y1.^2 ...
    +2*(dp(1)*y0+dp(2)*s0+dp(4)*s0(r,:,:)+dp(3)*(1-t1.^2).*y1),8,[]);
end
base=getenv('DDE_BIFTOOL');
addpath([base '/ddebiftool'],[base '/ddebiftool_utilities'],[base '/ddebiftool_extra_nmfm']);
warning('off','all');
par=str2num(getenv('PARAMETERS')); low=str2num(getenv('LOW')); high=str2num(getenv('HIGH'));
funcs=set_funcs('sys_rhs',@net,'sys_tau',@()5,'sys_dirderi',{@net1,@net2},'x_vectorized',true);
method=df_mthod('hopf'); method.point.print_residual_info=0;
method.point.postprocess='dde_hopf_postprocess'; method.point.preprocess='dde_jac2square_preprocess';
method.point.halting_accuracy=1e-12; method.point.newton_max_iterations=10;
method.continuation.plot=0; method.continuation.plot_progress=0;
all=load(getenv('TARGETS')); i=(0:7)';
for curve=unique(all(:,1))'
  some=all(all(:,1)==curve,:);
  one=some(ceil(end/2),:);
  % From three digits on: what it is corrected to is DDE-BIFTOOL's own.
  h=dde_hopf_create('parameter',[par(1:2) one(4) par(4) round(1e3*one(5))/1e3],'x',zeros(8,1), ...
    'v',(1i).^(one(2)*floor(i/2)).*(-1).^(one(3)*mod(i,2)),'omega',round(1e3*one(6))/1e3);
  free=5-2*one(7);
  [h,suc]=p_correc(funcs,h,free,[],method.point);
  br=df_brnch(funcs,[3 5],'hopf'); br.method=method; br.point=h;
  br.parameter.min_bound=[3 low(1);5 low(2)]; br.parameter.max_bound=[3 high(1);5 high(2)];
  br.parameter.max_step=[3 0.5;5 0.15];
  g=h; held=8-free; g.parameter(held)=g.parameter(held)+0.01;
  [g,suc2]=p_correc(funcs,g,free,[],method.point); br.point(2)=g;
  br=br_contn(funcs,br,200); br=br_rvers(br); br=br_contn(funcs,br,200);
  where=cell2mat(arrayfun(@(p)p.parameter([3 5])',br.point,'UniformOutput',false));
  for k=1:size(some,1)
    [~,near]=min(sum(((where-some(k,4:5)')./(high-low)').^2));
    p=br.point(near); free=5-2*some(k,7);
    p.parameter(8-free)=some(k,4+(8-free==5));
    [p,suc]=p_correc(funcs,p,free,[],method.point);
    printf('RESULT %d %d %.15g %.15g %.15g\n',curve,suc,p.parameter(3),p.parameter(5),p.omega);
  end
end
