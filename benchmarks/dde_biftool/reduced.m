% Trot (1-D DDE) and walk (2-D DDE) of the delayed network reduced by symmetry, DDE-BIFTOOL's best case
1;
function f=rt(x,p)
  x0=x(1,1,:); x1=x(1,2,:); f=reshape(p(1)*x0+p(2)*tanh(x0)-p(4)*tanh(x0)-p(3)*tanh(x1),1,[]);
end
function f=rt1(x,p,dx,dp)
  x0=x(1,1,:); x1=x(1,2,:); y0=dx(1,1,:); y1=dx(1,2,:); t0=tanh(x0); t1=tanh(x1);
  f=reshape(p(1)*y0+(p(2)-p(4))*(1-t0.^2).*y0-p(3)*(1-t1.^2).*y1+dp(1)*x0+(dp(2)-dp(4))*t0-dp(3)*t1,1,[]);
end
function f=rt2(x,p,dx,dp)
  x0=x(1,1,:); x1=x(1,2,:); y0=dx(1,1,:); y1=dx(1,2,:); t0=tanh(x0); t1=tanh(x1); g=@(t)-2*t.*(1-t.^2);
  f=reshape((p(2)-p(4))*g(t0).*y0.^2-p(3)*g(t1).*y1.^2+2*(dp(1)*y0+(dp(2)-dp(4))*(1-t0.^2).*y0-dp(3)*(1-t1.^2).*y1),1,[]);
end
function f=rw(x,p)
  x0=x(:,1,:); x1=x(:,2,:); r=[2 1]; sg=reshape([-1;1],2,1,1); t0=tanh(x0);
  f=reshape(p(1)*x0+p(2)*t0+p(4)*(sg.*t0(r,:,:))-p(3)*tanh(x1),2,[]);
end
function f=rw1(x,p,dx,dp)
  x0=x(:,1,:); x1=x(:,2,:); y0=dx(:,1,:); y1=dx(:,2,:); r=[2 1]; sg=reshape([-1;1],2,1,1); t0=tanh(x0); t1=tanh(x1);
  s0=(1-t0.^2).*y0;
  f=reshape(p(1)*y0+p(2)*s0+p(4)*(sg.*s0(r,:,:))-p(3)*(1-t1.^2).*y1+dp(1)*x0+dp(2)*t0+dp(4)*(sg.*t0(r,:,:))-dp(3)*t1,2,[]);
end
function f=rw2(x,p,dx,dp)
  x0=x(:,1,:); x1=x(:,2,:); y0=dx(:,1,:); y1=dx(:,2,:); r=[2 1]; sg=reshape([-1;1],2,1,1); t0=tanh(x0); t1=tanh(x1);
  g=@(t)-2*t.*(1-t.^2); q0=g(t0).*y0.^2; s0=(1-t0.^2).*y0;
  f=reshape(p(2)*q0+p(4)*(sg.*q0(r,:,:))-p(3)*g(t1).*y1.^2+2*(dp(1)*y0+dp(2)*s0+dp(4)*(sg.*s0(r,:,:))-dp(3)*(1-t1.^2).*y1),2,[]);
end
base=getenv('DDE_BIFTOOL');
addpath([base '/ddebiftool'],[base '/ddebiftool_utilities'],[base '/ddebiftool_extra_nmfm'],[base '/ddebiftool_extra_psol']);
warning('off','all');
par=[-4.5 1 6.5 -2 0.2];
F={set_funcs('sys_rhs',@rt,'sys_tau',@()5,'sys_dirderi',{@rt1,@rt2},'x_vectorized',true), ...
   set_funcs('sys_rhs',@rw,'sys_tau',@()5,'sys_dirderi',{@rw1,@rw2},'x_vectorized',true)};
names={'trot','walk'}; V={1,[1;1i]}; TC=[0.285184398538 0.286123055348]; OM=[6.324555320337 7.477225575052];
for ic=1:2
  name=names{ic}; funcs=F{ic}; n=ic;
  h=dde_hopf_create('parameter',[par(1:4) TC(ic)],'x',zeros(n,1),'v',V{ic},'omega',OM(ic));
  hb=df_brnch(funcs,5,'hopf'); hb.point=h; mth=df_mthod('hopf'); hb.method.point=mth.point;
  [per,suc]=SetupPsol(funcs,hb,1,'contpar',5,'degree',8,'intervals',20,'radius',0.02,'max_step',[5 0.02],'max_bound',[5 0.5],'min_bound',[5 0.2],'plot',0);
  per.method.continuation.plot=0; per.method.continuation.plot_progress=0; per.method.point.print_residual_info=0;
  c=cputime; [per,s,f,r]=br_contn(funcs,per,20); t_c=cputime-c;
  taus=arrayfun(@(p)p.parameter(5),per.point);
  [~,k]=min(abs(taus-0.4)); p=per.point(k); p.parameter(5)=0.4;
  [q,suc]=p_correc(funcs,p,[],[],per.method.point);
  printf('RESULT %s %d %.3f %.13f\n',name,numel(taus),1e3*t_c/s,q.period);
end
